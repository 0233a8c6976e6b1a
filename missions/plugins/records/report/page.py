"""The report of a recorded run: one page that tells how it went, and shows any moment of it."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from importlib.resources import files

from config.faults import InvalidFileError, Source
from config.world import WorldConfig, read_world
from drivers.api import BASE_RADIUS
from missions.library.worlds import build_world
from missions.plugins.pictures.page.document import Markup, document, join, start, tag
from missions.plugins.pictures.page.tree import button, tools, tree
from missions.plugins.pictures.plan import METRE, frame_of, plan
from missions.plugins.records.recording.read import Record
from missions.plugins.records.report.chart import chart, route_chart, seen_from_above, way_in_metres
from missions.plugins.records.report.lanes import timeline
from missions.plugins.records.report.percepts import Picture
from missions.plugins.records.report.slider import (
    Moments,
    Texts,
    Variable,
    changes,
    compact,
    failures,
    value_at,
    variables,
)
from missions.plugins.records.report.summary import Study, sentences, verdict
from missions.plugins.records.report.tables import about, began, faults_table, joints_table, log_table, sightings_table
from missions.plugins.records.report.traces import SHORTEST, Route, thinned
from missions.trees.draw import at
from missions.trees.drawing import SIGNS
from missions.trees.states import STATUSES, now_of
from missions.trees.words import in_seconds, names_in

# The plan of the world that a run took place in, with the way of the robot on it; none for a run in the real world.

WORLDS = "world/"
"""What the names of world files in a record begin with."""


def world_of(record: Record) -> WorldConfig | None:
    """Return the world that a record was made in; None where it has none that can be read."""
    found = []
    for name, data in record.files.items():
        if name.startswith(WORLDS):
            try:
                found.append(read_world(Source(name, data.decode("utf-8-sig"))))
            except (InvalidFileError, UnicodeDecodeError):
                continue
    named = [world for world in found if world.name == record.head.world]
    return next(iter(named or found), None) if record.head.simulate else None


def floor(record: Record, route: Route) -> Markup:
    """Return the plan, as the world was at the beginning; the script moves ``.robot`` along the way on it."""
    config = world_of(record)
    if config is None:
        return join()
    world = build_world(config)
    frame = frame_of(world)
    picture = b64encode(plan(config.name, world, config.summary).encode()).decode()
    drawn = start("img", src=f"data:image/svg+xml;base64,{picture}", alt=f"Plan of the world {config.name}")
    if route.places:
        # The way is drawn as it is without a plan, ahead being up: here ahead is where the robot looked at first.
        put = f"translate({frame.x:g} {frame.y:g}) rotate({90 - frame.heading:.3f}) scale({METRE})"
        way = tag("g", way_in_metres(route, BASE_RADIUS), transform=put)
        label = f"The way of the base, {route.length:.1f} m long"
        size = f"0 0 {frame.width:g} {frame.height:g}"
        drawn = join(drawn, tag("svg", way, viewBox=size, class_="on-plan", role="img", aria_label=label))
    return tag("div", drawn, class_="plan card")


PLAY = "\N{BLACK RIGHT-POINTING TRIANGLE} Play"

SPEEDS = (1, 2, 5, 20)
"""How fast a run may be played, in times of how fast it was."""

HERE = files(__name__.rpartition(".")[0])
"""The folder of ``report.css`` and ``report.js``."""


def page(study: Study) -> str:
    """Return the report. It opens at the beginning of the run; without a script it shows its end."""
    record, moments, texts = study.record, study.moments, Texts()
    named = variables(record, study.drawing, moments, texts)
    states = {key: now_of(change) for key, change in record.statuses(moments.end).items()}
    drawing = at(study.drawing, states, moments.end)
    label = f"Mission {drawing.mission}"
    now = tag("div", _seen(study.pictures), _variables(named, moments, texts), class_="now")
    shown = tag("div", tag("div", tools(drawing), tree(drawing, label=label)), now, class_="moment")
    body = join(
        _header(study),
        _timebar(moments),
        _section("At this moment", shown),
        _floor(study),
        _section("Timeline", timeline(study.lanes, moments)),
        _sight(study),
        _traces(study),
        _joints(study),
        _section("Faults and reflexes", faults_table(record, moments)),
        _section("Said and logged", log_table(record, moments)),
        _section("About this record", about(record), _source(study)),
    )
    data = {**_data(study, texts), "variables": [variable.rows for variable in named]}
    assets = [HERE / "report.css", HERE / "report.js"]
    return document(f"{drawing.mission}: report", body, data={**data, "texts": texts.all()}, assets=assets)


def _header(study: Study) -> Markup:
    record = study.record
    result = verdict(record)[0]
    sign = f"{SIGNS[STATUSES[result]]} " if result in STATUSES else ""
    badge = join(" ", tag("span", sign, result, class_=f"verdict {result}")) if result else ""
    facts = [
        record.head.robot,
        record.head.world or ("simulated" if record.head.simulate else "the real world"),
        began(record),
    ]
    return tag(
        "header",
        tag("h1", f"Mission {record.head.mission}", badge),
        tag("p", study.drawing.summary) if study.drawing.summary else "",
        tag("p", " · ".join(filter(None, facts)), class_="facts"),
        tag("ul", *(tag("li", sentence) for sentence in sentences(study)), class_="summary"),
    )


def _timebar(moments: Moments) -> Markup:
    last = len(moments.times) - 1
    slider = start(
        "input", type="range", id="slider", min=0, max=last, step=1, value=0, autocomplete="off",
        aria_label="Time", aria_valuetext=in_seconds(moments.end),
    )  # fmt: skip
    speeds = (tag("option", f"{times} x", value=times, selected=times == 1) for times in SPEEDS)
    play = tag(
        "span",
        button(PLAY, id="play"),
        tag("select", *speeds, id="speed", aria_label="Speed", autocomplete="off"),
        class_="player",
    )
    jumps = tag(
        "span",
        button("\N{LEFTWARDS ARROW} Failure", data_jump="previous", aria_label="Previous failure"),
        button("Failure \N{RIGHTWARDS ARROW}", data_jump="next", aria_label="Next failure"),
        class_="joined jumps",
    )
    clock = tag("div", tag("b", in_seconds(moments.end)), tag("span", f"tick {moments.ticks[-1]}"), id="clock")
    said = (tag("button", type="button", class_="link"), tag("span"))
    note = tag("div", *said, role="status", id="note")
    return tag("div", play, clock, slider, jumps, note, class_="timebar", role="group", aria_label="Time", hidden=True)


def _floor(study: Study) -> Markup:
    """Return the section with the plan and the way on it; none for a run in the real world."""
    drawn = floor(study.record, study.route)
    return _section("Where it went", drawn) if drawn else drawn


def _section(title: str, *content: str) -> Markup:
    return tag("section", tag("h2", title), *content, aria_label=title)


def _seen(pictures: Sequence[Picture]) -> Markup:
    """Return the place of the picture that the robot had at that moment."""
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


def _variables(named: Sequence[Variable], moments: Moments, texts: Texts) -> Markup:
    said, last = texts.all(), len(moments.times) - 1
    rows = []
    for number, variable in enumerate(named):
        row = value_at(variable.rows, last)
        within = tag("small", f"in {variable.within}") if variable.within else ""
        rows.append(
            tag(
                "tr",
                tag("th", variable.name, " ", within, scope="row"),
                tag("td", said[row[1]] if row is not None else "", data_variable=number),
            )
        )
    table = tag("table", tag("tbody", *rows), class_="variables") if rows else tag("p", "It has none.", class_="none")
    return tag("div", tag("h3", "Variables, in SI units"), table, class_="card")


def _sight(study: Study) -> Markup:
    """Return the section of what was seen; none without a camera."""
    if not (study.pictures or study.sightings):
        return join()
    shots = [
        tag(
            "button", _image(picture), tag("b", in_seconds(picture.time)), tag("span", picture.caption),
            type="button", class_="shot", data_place=study.moments.place(picture.time), title=_caption(picture),
        )
        for picture in study.pictures
    ]  # fmt: skip
    strip = tag("div", *shots, class_="strip") if shots else tag("p", "There are no pictures in it.", class_="none")
    found = sightings_table(study.sightings, study.moments) if study.sightings else ""
    return _section("What it saw", strip, found)


def _traces(study: Study) -> Markup:
    drawn = [chart(each, study.moments) for each in study.charts]
    if study.route.length > SHORTEST and world_of(study.record) is None:
        drawn.append(route_chart(study.route))
    if not drawn:
        return join()
    return _section("Head and base", tag("div", *drawn, class_="charts"))


def _joints(study: Study) -> Markup:
    """Return the section of the joints; none for a robot that has none."""
    if not study.joints:
        return join()
    drawn = [chart(each, study.moments) for each in study.joint_charts]
    charts = tag("div", *drawn, class_="charts") if drawn else join()
    return _section("Joints", joints_table(study.joints, study.moments), charts)


def _source(study: Study) -> Markup:
    """Return the mission's file, to be unfolded."""
    data = study.record.files.get(study.record.head.file)
    if data is None:
        return join()
    return tag("details", tag("summary", "The mission as it was"), tag("pre", data.decode(errors="replace")))


def _image(picture: Picture) -> Markup:
    address = f"data:image/jpeg;base64,{b64encode(picture.jpeg).decode()}"
    return start("img", src=address, width=picture.width, height=picture.height, alt=f"Picture: {picture.caption}")


def _caption(picture: Picture) -> str:
    return f"{in_seconds(picture.time)}: {picture.caption}"


def _failures(study: Study) -> list[tuple[int, str, str]]:
    """Return where nodes failed, which was the first there, and that in words."""
    names = names_in(study.drawing)
    found = []
    for place, first in failures(study.record, study.moments):
        node = names[first.node].title if first.node in names else first.name
        why = f": {first.reason}" if first.reason else ""
        found.append((place, first.node, f"{SIGNS['failure']} {node} failed{why}"))
    return found


def _data(study: Study, texts: Texts) -> Mapping[str, object]:
    """Return what the script needs, as the top of report.js says."""
    moments = study.moments
    lines = {
        f"{drawn.key}/{number}": [
            (moments.place(time), float(f"{value:.3g}"))
            for time, value in thinned(line.points, moments.begin, moments.span)
        ]
        for drawn in (*study.charts, *study.joint_charts)
        for number, line in enumerate(drawn.lines)
    }
    return {
        "times": compact(moments.times),
        "ticks": moments.ticks,
        "statuses": list(SIGNS),
        "changes": changes(study.record, moments, texts),
        "failures": _failures(study),
        "lines": lines,
        "route": [
            (moments.place(time), *seen_from_above(at))
            for time, at in zip(study.route.times, study.route.places, strict=True)
        ],
    }
