// Connection to the studio: reconnects, matches answers to commands, measures age and round trip.

const PING_INTERVAL = 1000; // milliseconds between two `hello`
const LINK_TIMEOUT = 5000; // milliseconds without a message after which the connection counts as lost
const REPLY_TIMEOUT = 15000; // milliseconds
const LIBRARY_TIMEOUT = 120000; // milliseconds; the studio reads all missions for it
const RETRY_DELAYS = [300, 600, 1200, 2500, 5000];

export const VERSION = document.querySelector("meta[name=version]").content;

/** Error of the protocol: name, message and hint. */
export class StudioError extends Error {
  constructor({ error = "fault", message = "", hint = "" }) {
    super(message || error);
    this.error = error;
    this.hint = hint;
  }
}

let proof = ""; // bound to this origin, while the cookie goes to servers on other ports too

export function store_proof(address) {
  const url = new URL(address);
  proof = url.searchParams.get("proof") ?? proof;
  try {
    if (url.searchParams.has("proof")) localStorage.setItem("proof", proof);
  } catch {
    // no storage: kept until the page is reloaded
  }
  url.searchParams.delete("proof");
  return url;
}

/** Return the newest proof, also if another tab has signed in since. */
function stored_proof() {
  try {
    proof = localStorage.getItem("proof") ?? proof;
  } catch {
    // no storage in this browser
  }
  return encodeURIComponent(proof);
}

history.replaceState(null, "", store_proof(location.href));

/** Return the address of the websocket, with the proof. */
export function address() {
  return new URL(`ws${location.protocol === "https:" ? "s" : ""}://${location.host}/ws?proof=${stored_proof()}`);
}

export class Link {
  /** `how` is connecting, open, lost, refused or old. */
  how = "connecting";
  heard = -Infinity;
  welcome = null;
  #socket = null;
  #pending = new Map();
  #listeners = new Map();
  #number = 0;
  #version;
  #tries = 0;
  #timer = 0;
  #pings = []; // id and time of each unanswered `hello`
  #last_round_trip = 0;

  /** `version` is sent in `hello`: that of the page, or of the protocol, which works for a page of any age. */
  constructor(version = VERSION) {
    this.#version = version;
    setInterval(() => this.#check_alive(), PING_INTERVAL);
    addEventListener("online", () => this.retry());
    document.addEventListener("visibilitychange", () => document.hidden || this.retry());
    this.#open();
  }

  /** Call `heard` with each message of a type; "how" reports the status of the connection. */
  on(word, heard) {
    if (!this.#listeners.has(word)) this.#listeners.set(word, []);
    this.#listeners.get(word).push(heard);
  }

  /** Milliseconds since the last message. */
  get age() {
    return performance.now() - this.heard;
  }

  get open() {
    return this.how === "open";
  }

  /** Round trip of the last `hello` in milliseconds, or the time that an unanswered one has waited so far. */
  get roundTrip() {
    return Math.max(this.#last_round_trip, this.#pings.length ? performance.now() - this.#pings[0].sent : 0);
  }

  send(command) {
    if (!this.open || this.#socket.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(JSON.stringify(command));
    return true;
  }

  /** Send a command and return its result. Throws StudioError. */
  ask(command, timeout = REPLY_TIMEOUT) {
    return new Promise((resolve, reject) => {
      const id = ++this.#number;
      if (!this.send({ ...command, id })) {
        reject(new StudioError({ error: "lost", message: "No connection to the studio: nothing was sent." }));
        return;
      }
      const timer = setTimeout(() => this.#settle(id, { ok: false, error: "no_answer", message: "The studio did not reply in time." }), timeout);
      this.#pending.set(id, { resolve, reject, timer });
    });
  }

  /** Return missions, robots and worlds, unless `edition` is still current. The first call takes long. */
  library(edition = "") {
    return this.ask({ do: "library", edition }, LIBRARY_TIMEOUT);
  }

  /** Reconnect now if the connection is lost; with a new cookie, also if it was refused. */
  retry(with_new_cookie = false) {
    if (this.how !== "lost" && !(with_new_cookie && this.how === "refused")) return;
    clearTimeout(this.#timer);
    this.#set_status("lost");
    this.#open();
  }

  #open() {
    const socket = new WebSocket(address());
    this.#socket = socket;
    socket.onopen = () => {
      this.heard = performance.now();
      this.#pings = [];
      this.#ping();
    };
    socket.onmessage = (event) => socket === this.#socket && this.#receive(event.data);
    socket.onclose = () => socket === this.#socket && this.#on_close();
  }

  #receive(text) {
    this.heard = performance.now();
    const message = JSON.parse(text);
    if (message.say === "answer") {
      if (message.error === "old_page") this.#set_status("old");
      else if (this.#pings.some(({ id }) => id === message.id)) this.#pong(message.id); // refused, for example after too many commands
      else if (message.id !== undefined && message.id !== null) this.#settle(message.id, message);
      else this.#emit("trouble", new StudioError(message));
      return;
    }
    if (message.say === "welcome") {
      this.welcome = message;
      if (this.#pings.length) this.#pong(this.#pings[0].id);
      this.#tries = 0;
      this.#set_status(this.#version === VERSION && message.page !== VERSION ? "old" : "open");
    }
    this.#emit(message.say, message);
  }

  #settle(id, answer) {
    const pending = this.#pending.get(id);
    if (!pending) return;
    this.#pending.delete(id);
    clearTimeout(pending.timer);
    if (answer.ok) pending.resolve(answer.result ?? {});
    else pending.reject(new StudioError(answer));
  }

  #on_close() {
    this.#socket.onmessage = this.#socket.onclose = null;
    for (const id of [...this.#pending.keys()]) this.#settle(id, { ok: false, error: "lost", message: "The connection was lost before the reply." });
    if (this.how === "old" || this.how === "refused") return;
    this.#set_status("lost");
    const wait = RETRY_DELAYS[Math.min(this.#tries++, RETRY_DELAYS.length - 1)];
    this.#timer = setTimeout(() => this.#open(), wait * (0.75 + Math.random() / 2));
    if (this.#tries === 2) this.#check_refusal();
  }

  /** Find out whether the connection was refused: a websocket does not report that, a plain request does. */
  async #check_refusal() {
    const found = await fetch(`/?proof=${stored_proof()}`, { cache: "no-store", redirect: "manual" }).catch(() => null);
    if (this.how === "lost" && found && (found.status === 401 || found.status === 403 || found.type === "opaqueredirect")) {
      clearTimeout(this.#timer);
      this.#set_status("refused");
    }
  }

  #check_alive() {
    if (this.how !== "open") return;
    if (this.age > LINK_TIMEOUT) {
      this.#socket.close();
      this.#on_close();
    } else this.#ping();
  }

  /** Send `hello`, whose answer proves that the connection works and gives the round trip. */
  #ping() {
    const id = ++this.#number;
    this.#pings.push({ id, sent: performance.now() });
    this.#socket.send(JSON.stringify({ do: "hello", version: this.#version, id }));
  }

  #pong(id) {
    const at = this.#pings.findIndex((each) => each.id === id);
    const [{ sent }] = this.#pings.splice(at, 1);
    this.#last_round_trip = performance.now() - sent;
  }

  #set_status(how) {
    if (this.how === how) return;
    this.how = how;
    this.#emit("how", how);
  }

  #emit(word, message) {
    for (const heard of this.#listeners.get(word) ?? []) heard(message);
  }
}
