// Numbers and events as texts.

export const SIGNS = { idle: "○", running: "▶", suspended: "‖", success: "✓", skipped: "»", failure: "✗", interrupted: "■", error: "!" };

/** Return whether a node with this status has started and not ended. */
export const isActive = (status) => status === "running" || status === "suspended";

/** Return seconds as "4.2 s", "3:05 min" or "1:03:05 h". */
export function seconds(t) {
  if (!Number.isFinite(t)) return "";
  if (t < 60) return `${t.toFixed(1)} s`;
  const whole = Math.floor(t);
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  const rest = String(whole % 60).padStart(2, "0");
  return hours ? `${hours}:${String(minutes).padStart(2, "0")}:${rest} h` : `${minutes}:${rest} min`;
}

/** Return a Unix time in the user's locale. */
export function day(unix) {
  if (!unix) return "";
  return new Date(unix * 1000).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
}

/** Return a size in bytes as a text: "1.2 MB". */
export function bytes(size) {
  const steps = ["B", "kB", "MB", "GB"];
  let step = 0;
  while (size >= 1000 && step < 3) [size, step] = [size / 1000, step + 1];
  return `${size >= 10 || !step ? Math.round(size) : size.toFixed(1)} ${steps[step]}`;
}

export const plain = (name) => String(name).replaceAll("_", " ");

export const heading = ({ name, title, own }) => (own ? `${plain(title)} (${name.split("/").at(-1)})` : plain(title ?? name));

/** Return a number with two or three significant digits. */
export function figure(value) {
  if (typeof value !== "number") return String(value);
  return String(Math.abs(value) < 1 ? +value.toPrecision(2) : +value.toFixed(Math.abs(value) < 10 ? 2 : 1));
}

const DEGREES = 180 / Math.PI;
const METRES = ["m", 1, 2];
const ANGLE = ["°", DEGREES, 0];
const RATE = ["°/s", DEGREES, 0];
const SPEED = ["m/s", 1, 2];
const COUNT = ["", 1, 0];
const SIZES = { x: METRES, y: METRES, nearest: METRES, distance: METRES, heading: ANGLE, pan: ANGLE, tilt: ANGLE, roll: ANGLE, pitch: ANGLE, yaw: ANGLE,
  bearing: ANGLE, speed: SPEED, linear: SPEED, requested_linear: SPEED, turn: RATE, angular: RATE, requested_angular: RATE, battery: ["%", 1, 0], hottest: ["°C", 1, 0], joints: COUNT, moving: COUNT };

/** Return a value with its name and unit, "speed 0.25 m/s"; a count as "6 joints". */
export function sized(name, value) {
  const [unit, factor, digits] = SIZES[name] ?? [];
  if (unit === undefined || typeof value !== "number") return `${plain(name)} ${figure(value)}`;
  const number = String(+(value * factor).toFixed(digits));
  return unit ? `${plain(name)} ${number}${unit.startsWith("°") && unit !== "°C" ? "" : " "}${unit}` : `${number} ${plain(name)}`;
}

/** Return the text for a run's kind of simulation. */
export const simulation_text = (simulated) => ({ "": "on the robot", wire: "simulated (wire)", fast: "simulated (fast)" })[simulated] ?? simulated;

/** Return a result with its sign and reason. */
export function result_text(result, reason) {
  const sign = SIGNS[result] ?? "?";
  return `${sign} ${result || "unknown result"}${reason ? `: ${reason}` : ""}`;
}

const LINES = {
  started: (e) => ["", `${e.mission} starts on ${e.robot}`],
  ended: (e) => [e.result === "success" ? "good" : "bad", `${e.mission} ended: ${e.result}${e.reason ? `, ${e.reason}` : ""}`],
  reflex: (e) => [e.on ? "warn" : "", `${plain(e.condition)}${e.where ? ` (${e.where})` : ""}${e.on ? "" : " cleared"}`],
  fault: (e) => [e.status === "online" ? "" : "bad", `${e.part}: ${e.status === "online" ? "connected" : e.detail || e.status}${e.hint ? `. Try: ${e.hint}` : ""}`],
  notice: (e) => ["warn", `notice: ${e.text}`],
  command: (e) => ["", `${e.to}: ${Object.entries(e.values ?? {}).map(([name, value]) => sized(name, value)).join(", ")}`],
};

export function line(event) {
  if (event.event === "log") {
    if (event.level === "voice") return ["said", event.text];
    if (event.level === "person") return ["heard", event.text];
    return [{ warning: "warn", error: "bad", critical: "bad" }[event.level] ?? "", event.text];
  }
  const words = LINES[event.event];
  if (words) return words(event);
  const values = Object.entries(event).filter(([name]) => name !== "t").map(([, value]) => value);
  return ["", values.map((value) => (typeof value === "object" ? JSON.stringify(value) : value)).join(" ")];
}

/** Return whether an event has no line in the log: the voice's command is shown as its speech. */
export const is_hidden = (event) => event.event === "command" && event.to === "voice";
