"""Plug-ins of other distributions: found by their entry points; a broken one is named, and the rest works."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from missions.library import plugins
from missions.plugin import RUN, CommandEntry, FileKind, Plugin
from tests.cases import each

COMMAND = "{'dance': CommandEntry(BY_HAND, 'plug_dance:STEPS', 'Dance.')}"
HEAD = "from missions.plugin import BY_HAND, CommandEntry, FileKind, Plugin\n"


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on the path in which distributions can be installed."""
    monkeypatch.syspath_prepend(str(tmp_path))
    for cached in (plugins.built_in_plugins, plugins.installed_plugins):
        cached.cache_clear()
    yield tmp_path
    plugins.installed_plugins.cache_clear()
    for module in [name for name in sys.modules if name.startswith("plug_")]:
        del sys.modules[module]


def install(site: Path, name: str, body: str) -> None:
    """Install a distribution that declares the plug-in ``name`` in a module of its own."""
    (site / f"plug_{name}.py").write_text(HEAD + body, encoding="utf-8")
    info = site / f"plug_{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: plug-{name}\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(f"[missiontree.plugins]\n{name} = plug_{name}:IT\n", encoding="utf-8")


def test_plugins_without_other_distributions_are_built_in(site: Path) -> None:
    del site
    assert [each.name for each in plugins.plugins()] == [*plugins.built_in_plugins()]


def test_plugin_of_another_distribution_is_found_and_loaded(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kinds = "{'.dance': FileKind(check='plug_dance:STEPS')}"
    install(site, "dance", f"IT = Plugin('dance', commands={COMMAND}, file_kinds={kinds})\nSTEPS = 3\n")
    found = plugins.find_command("dance")
    assert found is not None
    assert plugins.load(found[0], found[1].path) == 3
    kind = plugins.find_file_kind("a/b.dance")
    assert kind is not None
    assert kind[1].check == "plug_dance:STEPS"
    assert plugins.find_file_kind("b.yaml") is None
    assert not capsys.readouterr().err


BROKEN = {
    "number": ("IT = 3\n", "is 3, not a missions.plugin.Plugin"),
    "raising": ("raise RuntimeError('no robot')\n", "RuntimeError: no robot"),
    "importing": ("import not_there\n", "No module named 'not_there'"),
    "ending": ("import os\nos._exit(3)\n", "ends the process with exit code 3"),
    "crashing": ("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n", "SIGSEGV"),
    "exiting": ("import sys\nsys.exit()\n", "SystemExit"),
    "torn": ("x = (\n", "SyntaxError"),
    "misnamed": ("IT = Plugin('other')\n", "declares the plug-in 'other': both must have the same name"),
    "needy": ("IT = Plugin('needy', needs=('nothing',))\n", "needs the plug-in nothing, which is not installed"),
    "circular": ("IT = Plugin('circular', needs=('circular',))\n", "needs the plug-in circular"),
    "behind": ("IT = Plugin('behind', needs=('number',))\n", "needs the plug-in number, which is not installed"),
    "untyped": ("IT = Plugin('untyped', commands=None)\n", "has commands that are not a mapping"),
    "later": (f"IT = Plugin('later', commands={COMMAND})\n", "command 'dance' is taken by the plug-in 'able'"),
    "reader": ("IT = Plugin('reader', file_kinds={'.dance': FileKind()})\n", "kind of file '.dance' is taken"),
    "testing": ("IT = Plugin('testing')\n", "a plug-in 'testing' exists already"),
}
"""Plug-ins that cannot be used, each with the reason."""


def test_broken_plug_ins_are_named_and_the_rest_works(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    install(site, "able", f"IT = Plugin('able', commands={COMMAND}, file_kinds={{'.dance': FileKind()}})\n")
    for name, (body, _) in BROKEN.items():
        install(site, name, body)
    assert [*plugins.installed_plugins()] == ["able"]
    said = capsys.readouterr().err
    for name, (_, why) in BROKEN.items():
        line = next(
            each for each in said.splitlines() if f"skipped plug-in {name} = plug_{name}:IT of plug-{name}" in each
        )
        assert why in line
        assert f"uninstall plug-{name}" in said
    plugins.installed_plugins()
    assert not capsys.readouterr().err  # once in a process


def test_plugin_may_need_a_plugin_found_later(site: Path) -> None:
    install(site, "alpha", "IT = Plugin('alpha', needs=('omega',))\n")
    install(site, "omega", "IT = Plugin('omega', needs=('testing',))\n")
    assert {*plugins.installed_plugins()} == {"alpha", "omega"}


def test_unloadable_plugin_is_reported_with_its_extra() -> None:
    broken = Plugin("dance", extra="music", commands={"dance": CommandEntry(RUN, "not_there:command", "")})
    with pytest.raises(plugins.BrokenPluginError, match="the plug-in 'dance' cannot be loaded") as caught:
        plugins.load(broken, broken.commands["dance"].path)
    assert "not_there" in str(caught.value)
    assert "pip install 'missiontree[music]'" in str(caught.value)


@each("path", ["json:not_there", "json", "", ":", "json:"])
def test_invalid_plugin_path_is_reported_with_the_plugin(path: str) -> None:
    with pytest.raises(plugins.BrokenPluginError, match="the plug-in 'dance' cannot be loaded"):
        plugins.load(Plugin("dance"), path)


def test_without_our_plug_ins_the_core_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "BUILT_IN", "missions.not_there")
    plugins.built_in_plugins.cache_clear()
    assert not plugins.built_in_plugins()
    assert plugins.service("faults") is None
    plugins.built_in_plugins.cache_clear()


def test_every_path_of_built_in_plugins_loads() -> None:
    for plugin in plugins.built_in_plugins().values():
        kinds: list[FileKind] = [*plugin.file_kinds.values()]
        paths = [
            *(entry.path for entry in plugin.commands.values()), plugin.run_options, plugin.run_context,
            *(path for kind in kinds for path in kind), *plugin.services.values(),
        ]  # fmt: skip
        for path in filter(None, paths):
            assert plugins.load(plugin, path)
