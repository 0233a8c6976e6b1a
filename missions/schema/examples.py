"""Files in which every part stands once, for the readers to ask for its keys; several, where parts exclude others."""

_SERVOS = """
robot: example
base: {driver: kobuki, port: /dev/kobuki, reflexes: {}}
head: {driver: arduino, port: /dev/nano, pan: {servo: 0}, tilt: {servo: 1}}
arm:
  driver: dynamixel
  port: /dev/u2d2
  joints:
    elbow: {id: 1}
    wrist: {id: 2, model: MX-28, ticks: {}}
    hand: {id: 3, ticks: {}}
  groups: {all: [elbow]}
range: {driver: rplidar, port: /dev/lidar}
camera:
  distortion: {}
  markers: {robots: {7: R2}}
  identity: {}
microphone: {pronunciations: {ada: ada}}
voice: {}
screen: {port: 8080}
notices:
  - terminal
  - command: [notify-send]
  - webhook: {url_from: ADDRESS, headers: {name: text}}
  - mqtt: {}
"""
_NECK = """
robot: example
head: {driver: dynamixel, pan: {joint: pan}, tilt: {joint: tilt}}
arm:
  driver: dynamixel
  port: /dev/u2d2
  joints:
    pan: {id: 1}
    tilt: {id: 2}
"""
ROBOTS = (_SERVOS, _NECK)

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
