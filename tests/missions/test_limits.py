"""The largest and worst texts that a mission can be: refused or read, and cheap either way."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
from pathlib import Path
from behaviours.catalogue import LEAVES
from config.diagnostics import InvalidFileError, SourceText
from missions.language.document import check_plan

texts = {
    "a long list": "[" + "a," * 499_000 + "]",
    "deep": "[" * 500_000,
    "many mistakes": "mission: m\\ntree:\\n  sequence:\\n" + "    - x: 1\\n" * 90_000,
    "a long text": "mission: '" + "a" * 990_000 + "'",
    "aliases of aliases": "k0: &k0 [1,1,1,1,1,1,1,1,1,1]\\n"
    + "".join(f"k{n}: &k{n} [*k{n - 1}, *k{n - 1}]\\n" for n in range(1, 20_000)),
    "control codes": chr(0) * 900_000,
    "a deep expression": "mission: m\\ntree:\\n  log: '${" + "(" * 900 + "}'",
    "many leaves": "mission: m\\ntree:\\n  sequence:\\n" + "    - log: ${1 + 1}\\n" * 9_000,
}
for name, text in texts.items():
    try:
        check_plan(SourceText("worst.yaml", text), LEAVES, {})
        print(name, "read")
    except InvalidFileError as error:
        print(name, len(error.diagnostics), "mistakes")
status = Path("/proc/self/status")  # not getrusage, whose peak begins with that of the process that forked this one
print(next(int(line.split()[1]) // 1024 for line in status.read_text().splitlines() if line.startswith("VmHWM")))
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the peak is read from /proc, which is not here")
def test_no_text_makes_the_checker_raise_anything_else_or_use_more_than_200_mb() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    *found, peak = done.stdout.splitlines()
    assert found[-1] == "many leaves read"
    assert all("mistakes" in line for line in found[:-1])
    assert int(peak) < 200
