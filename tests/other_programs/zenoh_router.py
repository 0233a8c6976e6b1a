"""A router of Zenoh in a process of its own: `python zenoh_router.py CONFIG.json5`; it ends with its standard input."""

import sys

import zenoh

if __name__ == "__main__":
    with zenoh.open(zenoh.Config.from_file(sys.argv[1])):
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        sys.stdin.read()
