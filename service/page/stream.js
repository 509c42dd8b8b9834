// The WebSocket of a session: it comes back by itself, and says what it is waiting for.
//
// Events: "open"; "frame" with {header, blob}; "status"; "refused" with {id, problem}; "waiting" with
// {seconds}; "gone" with the Problem that says why there is nothing to come back to.

import { Problem, statusOf, token } from "./api.js";

const FIRST_WAIT = 0.5; // seconds, doubled at each failure
const LONGEST_WAIT = 8;
const MOST_REFUSALS = 4; // of a session whose worker is gone, which may yet be given another
const HEARTBEAT = 25; // seconds; the service ends streams that are silent for long

const encoded = (text) => btoa(String.fromCharCode(...new TextEncoder().encode(text)))
  .replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");

export class Stream extends EventTarget {
  #session;
  #socket = null;
  #wait = FIRST_WAIT;
  #refusals = 0;
  #timer = 0;
  #closed = false;
  #given = new AbortController(); // up, when it is closed
  #header = null;
  #number = 0;
  #answers = new Map();

  constructor(session) {
    super();
    this.#session = session;
    this.#heartbeat = setInterval(() => this.say({ type: "ping" }), 1000 * HEARTBEAT);
    this.#connect();
  }

  #heartbeat;

  get isOpen() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Send a message, if there is a connection. */
  say(message) {
    if (this.isOpen) this.#socket.send(JSON.stringify(message));
    return this.isOpen;
  }

  /** Send a message that is answered; resolves with the answer, rejects with a Problem. */
  ask(message) {
    if (!this.isOpen) return Promise.reject(new Problem(0, { detail: "There is no connection just now." }));
    this.#number += 1;
    const id = `ask-${this.#number}`;
    return new Promise((resolve, reject) => {
      this.#answers.set(id, { resolve, reject });
      this.say({ ...message, id });
    });
  }

  /** A frame was shown: the next may come. */
  acknowledge(number) {
    this.say({ type: "ack", number });
  }

  retry() {
    if (this.#closed || this.#socket) return;
    clearTimeout(this.#timer);
    this.#reconnect();
  }

  close() {
    this.#closed = true;
    this.#given.abort();
    clearInterval(this.#heartbeat);
    clearTimeout(this.#timer);
    this.#socket?.close();
  }

  #connect() {
    const url = new URL(`/v1/sessions/${this.#session}/stream`, location.href);
    url.protocol = url.protocol.replace("http", "ws");
    url.hash = "";
    const protocols = ["halflight.v1"];
    if (token.value) protocols.push(`bearer.${encoded(token.value)}`);
    const socket = new WebSocket(url, protocols);
    this.#socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.#wait = FIRST_WAIT;
      this.#refusals = 0;
      this.#tell("open");
    };
    socket.onmessage = ({ data }) => this.#hear(data);
    socket.onclose = () => this.#lost();
  }

  #hear(data) {
    if (typeof data !== "string") {
      const blob = new Blob([data], { type: this.#header.media_type });
      this.#tell("frame", { header: this.#header, blob });
      return;
    }
    const message = JSON.parse(data);
    if (message.type === "frame") this.#header = message;
    else if (message.type === "status") this.#tell("status", message.status);
    else if (message.type === "edited") this.#answered(message.id)?.resolve(message);
    else if (message.type === "error") {
      const problem = new Problem(message.problem.status, message.problem);
      const answer = this.#answered(message.id);
      if (answer) answer.reject(problem);
      else this.#tell("refused", { id: message.id, problem });
    }
  }

  #answered(id) {
    const answer = this.#answers.get(id);
    this.#answers.delete(id);
    return answer;
  }

  #lost() {
    this.#socket = null;
    for (const { reject } of this.#answers.values()) {
      reject(new Problem(0, { detail: "The connection was lost before the answer came." }));
    }
    this.#answers.clear();
    if (!this.#closed) this.#later();
  }

  #later() {
    this.#tell("waiting", { seconds: this.#wait });
    this.#timer = setTimeout(() => this.#reconnect(), 1000 * this.#wait);
    this.#wait = Math.min(2 * this.#wait, LONGEST_WAIT);
  }

  // A WebSocket that fails does not say why: a plain request does.
  async #reconnect() {
    try {
      await statusOf(this.#session, { signal: this.#given.signal });
    } catch (error) {
      if (this.#closed) return;
      this.#refusals = error.status === 503 ? this.#refusals + 1 : 0;
      if ([401, 403, 404].includes(error.status) || this.#refusals >= MOST_REFUSALS) {
        this.#tell("gone", error);
      } else {
        this.#later();
      }
      return;
    }
    if (!this.#closed) this.#connect();
  }

  #tell(name, detail = null) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
