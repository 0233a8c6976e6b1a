"""Files in which every part stands once, for the readers to ask for its keys; several, where parts exclude others."""

ROBOTS = (
    """
robot: example
notices:
  - terminal
  - command: [notify-send]
  - webhook: {url_from: ADDRESS, headers: {name: text}}
  - mqtt: {}
""",
)
"""What of a robot file is no part: those are told by their drivers' keys."""

WORLDS = (
    """
world: example
room: {length: 5 m, width: 5 m}
start: {at: [0 m, 0 m]}
physics: {battery: {}}
camera: {}
light:
  - {at: 1 s, light: 50 %}
walls: [{from: [0 m, 0 m], to: [1 m, 0 m]}]
furniture:
  - {name: table, at: [1 m, 1 m], size: [1 m, 1 m, 1 m]}
edges: [{at: [1 m, 2 m], size: [1 m, 1 m]}]
objects:
  - {name: ball, shape: ball, colour: red, size: 10 cm, at: [1 m, 0 m]}
  - {name: box, shape: box, colour: red, size: [10 cm, 10 cm, 10 cm], at: [2 m, 0 m]}
dock: {at: [2 m, 2 m], heading: 0 deg}
robots:
  - {name: R2, marker: 7, at: [2 m, 1 m]}
people:
  - {name: Anna, at: [1 m, 1 m], acts: [{at: 1 s, say: Hi, turn: away}]}
""",
)

TESTS = (
    """
tests: greet
behaviours: []
cases:
  - case: example
    params: {patience: 5 s}
    given:
      - camera unplugged
      - find_face: {does: succeeds, result: {id: 1}}
    expect: {result: success, pose: {near: [0 m, 0 m]}}
""",
)
