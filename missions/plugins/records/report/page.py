"""The report page: the result of a recorded run, and its state at any time."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from importlib.resources import files

from config.diagnostics import InvalidFileError, SourceText
from config.world import WorldConfig, parse_world
from drivers.api import BASE_RADIUS
from missions.library.worlds import build_world
from missions.plugins.pictures.page.document import Markup, document, join, start_tag, tag
from missions.plugins.pictures.page.tree import button, tools, tree
from missions.plugins.pictures.plan import UNITS_PER_METRE, plan_frame, plan_svg
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.report.chart import chart_figure, route_figure, route_markup, to_plan_view
from missions.plugins.records.report.sightings import ReportPicture
from missions.plugins.records.report.slider import (
    SliderTimes,
    TextTable,
    VariableHistory,
    failure_positions,
    round_times,
    status_changes,
    value_at,
    variable_histories,
)
from missions.plugins.records.report.summary import RecordStudy, summary_sentences, verdict
from missions.plugins.records.report.tables import (
    faults_table,
    joints_table,
    log_table,
    record_facts,
    sightings_table,
    start_text,
)
from missions.plugins.records.report.timeline_markup import timeline_markup
from missions.plugins.records.report.traces import MIN_ROUTE_LENGTH, BaseRoute, thin_points
from missions.trees.drawing import SIGNS
from missions.trees.drawing_builder import with_states
from missions.trees.states import STATUSES, state_after
from missions.trees.value_text import node_names, seconds_text

# Plan of the world with the path of the base; simulated runs only.

WORLD_PREFIX = "world/"
"""Prefix of the names of world files in a record."""


def recorded_world(record: RunRecord) -> WorldConfig | None:
    """Return the world of a simulated record; None without a readable world file."""
    found = []
    for name, data in record.files.items():
        if name.startswith(WORLD_PREFIX):
            try:
                found.append(parse_world(SourceText(name, data.decode("utf-8-sig"))))
            except (InvalidFileError, UnicodeDecodeError):
                continue
    named = [world for world in found if world.name == record.header.world]
    return next(iter(named or found), None) if record.header.simulate else None


def floor_plan(record: RunRecord, route: BaseRoute) -> Markup:
    """Return the plan of the world at the start of the run, with the path of the base.

    The page's script moves the element ``.robot`` along the path.
    """
    config = recorded_world(record)
    if config is None:
        return join()
    world = build_world(config)
    frame = plan_frame(world)
    picture = b64encode(plan_svg(config.name, world, config.summary).encode()).decode()
    drawn = start_tag("img", src=f"data:image/svg+xml;base64,{picture}", alt=f"Plan of the world {config.name}")
    if route.poses:
        # The path is drawn with the initial heading up; rotate it by the robot's initial heading on the plan.
        put = f"translate({frame.x:g} {frame.y:g}) rotate({90 - frame.heading:.3f}) scale({UNITS_PER_METRE})"
        way = tag("g", route_markup(route, BASE_RADIUS), transform=put)
        label = f"Path of the base, {route.length:.1f} m long"
        size = f"0 0 {frame.width:g} {frame.height:g}"
        drawn = join(drawn, tag("svg", way, viewBox=size, class_="on-plan", role="img", aria_label=label))
    return tag("div", drawn, class_="plan card")


PLAY_LABEL = "\N{BLACK RIGHT-POINTING TRIANGLE} Play"

SPEEDS = (1, 2, 5, 20)
"""Playback speeds of the report page, relative to real time."""

ASSET_FOLDER = files(__name__.rpartition(".")[0])
"""Folder of the page's ``report.css`` and ``report.js``."""


def report_page(study: RecordStudy) -> str:
    """Return the report as HTML. With JavaScript it opens at the beginning of the run, without at its end."""
    record, moments, texts = study.record, study.slider, TextTable()
    named = variable_histories(record, study.drawing, moments, texts)
    states = {key: state_after(change) for key, change in record.statuses(moments.end).items()}
    drawing = with_states(study.drawing, states, moments.end)
    label = f"Mission {drawing.mission}"
    now = tag("div", _current_picture(study.pictures), _variable_table(named, moments, texts), class_="now")
    shown = tag("div", tag("div", tools(drawing), tree(drawing, label=label)), now, class_="moment")
    body = join(
        _header(study),
        _timebar(moments),
        _section("State", shown),
        _floor_section(study),
        _section("Timeline", timeline_markup(study.lanes, moments)),
        _sight_section(study),
        _motion_section(study),
        _joint_section(study),
        _section("Faults and reflexes", faults_table(record, moments)),
        _section("Speech and log", log_table(record, moments)),
        _section("About this record", record_facts(record), _mission_source(study)),
    )
    data = {**_script_data(study, texts), "variables": [variable.rows for variable in named]}
    assets = [ASSET_FOLDER / "report.css", ASSET_FOLDER / "report.js"]
    return document(f"{drawing.mission}: report", body, data={**data, "texts": texts.all()}, assets=assets)


def _header(study: RecordStudy) -> Markup:
    record = study.record
    result = verdict(record)[0]
    sign = f"{SIGNS[STATUSES[result]]} " if result in STATUSES else ""
    badge = join(" ", tag("span", sign, result, class_=f"verdict {result}")) if result else ""
    facts = [
        record.header.robot,
        record.header.world or ("simulated" if record.header.simulate else "real world"),
        start_text(record),
    ]
    return tag(
        "header",
        tag("h1", f"Mission {record.header.mission}", badge),
        tag("p", study.drawing.summary) if study.drawing.summary else "",
        tag("p", " · ".join(filter(None, facts)), class_="facts"),
        tag("ul", *(tag("li", sentence) for sentence in summary_sentences(study)), class_="summary"),
    )


def _timebar(positions: SliderTimes) -> Markup:
    last = len(positions.times) - 1
    slider = start_tag(
        "input", type="range", id="slider", min=0, max=last, step=1, value=0, autocomplete="off",
        aria_label="Time", aria_valuetext=seconds_text(positions.end),
    )  # fmt: skip
    speeds = (tag("option", f"{times} x", value=times, selected=times == 1) for times in SPEEDS)
    play = tag(
        "span",
        button(PLAY_LABEL, id="play"),
        tag("select", *speeds, id="speed", aria_label="Speed", autocomplete="off"),
        class_="player",
    )
    jumps = tag(
        "span",
        button("\N{LEFTWARDS ARROW} Failure", data_jump="previous", aria_label="Previous failure"),
        button("Failure \N{RIGHTWARDS ARROW}", data_jump="next", aria_label="Next failure"),
        class_="joined jumps",
    )
    clock = tag("div", tag("b", seconds_text(positions.end)), tag("span", f"tick {positions.ticks[-1]}"), id="clock")
    said = (tag("button", type="button", class_="link"), tag("span"))
    note = tag("div", *said, role="status", id="note")
    return tag("div", play, clock, slider, jumps, note, class_="timebar", role="group", aria_label="Time", hidden=True)


def _floor_section(study: RecordStudy) -> Markup:
    """Return the section with the plan of the world and the path of the base; empty for a run in the real world."""
    drawn = floor_plan(study.record, study.route)
    return _section("Path", drawn) if drawn else drawn


def _section(title: str, *content: str) -> Markup:
    return tag("section", tag("h2", title), *content, aria_label=title)


def _current_picture(pictures: Sequence[ReportPicture]) -> Markup:
    """Return the figure for the picture at the selected time; without the page's script, of the last picture."""
    if not pictures:
        return join()
    newest = pictures[-1]
    return tag(
        "figure",
        _image(newest),
        tag("figcaption", _caption(newest)),
        id="seen",
        class_="card",
    )


def _variable_table(histories: Sequence[VariableHistory], slider: SliderTimes, texts: TextTable) -> Markup:
    said, last = texts.all(), len(slider.times) - 1
    rows = []
    for number, variable in enumerate(histories):
        row = value_at(variable.rows, last)
        within = tag("small", f"in {variable.submission}") if variable.submission else ""
        rows.append(
            tag(
                "tr",
                tag("th", variable.name, " ", within, scope="row"),
                tag("td", said[row[1]] if row is not None else "", data_variable=number),
            )
        )
    table = tag("table", tag("tbody", *rows), class_="variables") if rows else tag("p", "No variables.", class_="none")
    return tag("div", tag("h3", "Variables, in SI units"), table, class_="card")


def _sight_section(study: RecordStudy) -> Markup:
    """Return the section of pictures and percepts; empty without a camera."""
    if not (study.pictures or study.sightings):
        return join()
    shots = [
        tag(
            "button", _image(picture), tag("b", seconds_text(picture.time)), tag("span", picture.caption),
            type="button", class_="shot", data_place=study.slider.position(picture.time), title=_caption(picture),
        )
        for picture in study.pictures
    ]  # fmt: skip
    strip = tag("div", *shots, class_="strip") if shots else tag("p", "No pictures.", class_="none")
    found = sightings_table(study.sightings, study.slider) if study.sightings else ""
    return _section("Pictures and percepts", strip, found)


def _motion_section(study: RecordStudy) -> Markup:
    drawn = [chart_figure(each, study.slider) for each in study.charts]
    if study.route.length > MIN_ROUTE_LENGTH and recorded_world(study.record) is None:
        drawn.append(route_figure(study.route))
    if not drawn:
        return join()
    return _section("Head and base", tag("div", *drawn, class_="charts"))


def _joint_section(study: RecordStudy) -> Markup:
    """Return the section with charts and table of the joints; empty for a robot without joints."""
    if not study.joints:
        return join()
    drawn = [chart_figure(each, study.slider) for each in study.joint_charts]
    charts = tag("div", *drawn, class_="charts") if drawn else join()
    return _section("Joints", joints_table(study.joints, study.slider), charts)


def _mission_source(study: RecordStudy) -> Markup:
    """Return an HTML element that unfolds to the text of the mission file; empty if the record lacks the file."""
    data = study.record.files.get(study.record.header.file)
    if data is None:
        return join()
    return tag("details", tag("summary", "Mission file"), tag("pre", data.decode(errors="replace")))


def _image(picture: ReportPicture) -> Markup:
    address = f"data:image/jpeg;base64,{b64encode(picture.jpeg).decode()}"
    return start_tag("img", src=address, width=picture.width, height=picture.height, alt=f"Picture: {picture.caption}")


def _caption(picture: ReportPicture) -> str:
    return f"{seconds_text(picture.time)}: {picture.caption}"


def _failure_rows(study: RecordStudy) -> list[tuple[int, str, str]]:
    """Return slider position, node key and text of each failure; of several at one position, only the first."""
    names = node_names(study.drawing)
    found = []
    for place, first in failure_positions(study.record, study.slider):
        node = names[first.node].title if first.node in names else first.name
        why = f": {first.reason}" if first.reason else ""
        found.append((place, first.node, f"{SIGNS['failure']} {node} failed{why}"))
    return found


def _script_data(study: RecordStudy, texts: TextTable) -> Mapping[str, object]:
    """Return the data for the page's script; report.js documents them."""
    moments = study.slider
    lines = {
        f"{drawn.key}/{number}": [
            (moments.position(time), float(f"{value:.3g}"))
            for time, value in thin_points(line.points, moments.start, moments.span)
        ]
        for drawn in (*study.charts, *study.joint_charts)
        for number, line in enumerate(drawn.lines)
    }
    return {
        "times": round_times(moments.times),
        "ticks": moments.ticks,
        "statuses": list(SIGNS),
        "changes": status_changes(study.record, moments, texts),
        "failures": _failure_rows(study),
        "lines": lines,
        "route": [
            (moments.position(time), *to_plan_view(at))
            for time, at in zip(study.route.times, study.route.poses, strict=True)
        ],
    }
