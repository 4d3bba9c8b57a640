// The WebSocket: events wait here until the server has them, so that a lost connection loses nothing.
import type { Command, Event, ServerMessage, State } from "./protocol";

// Events in one message: small enough for the server's limit after a long time without a connection.
const MOST_EVENTS = 500;
// Time between two messages, and before another attempt, milliseconds.
const SEND_STEP = 8;
const RETRY = 500;
// How a visitor's connection ends while another person is here, and the time before the next attempt.
const OCCUPIED = 4001;
const OCCUPIED_RETRY = 3000;

export interface Listener {
  message(message: ServerMessage): void;
  binary(data: ArrayBuffer): void;
  connected(open: boolean): void;
  /** Another person is here. */
  occupied(): void;
  /** Events before this one are on their way. */
  sent(before: number): void;
}

export class Connection {
  private socket: WebSocket | null = null;
  private key = "";
  private next = 0;
  // Events that the server does not have yet; those before `sent` are on their way.
  private unsent: Event[] = [];
  private sent = 0;
  private answers = 0;
  /** When the messages left that are not answered yet, and how long the answers took, milliseconds. */
  private left: number[] = [];
  private latest = 0;
  private due = false;
  readonly roundTrips: number[] = [];
  private stalled = false;
  private welcomed = false;
  private ended = false;
  private readonly listener: Listener;

  constructor(listener: Listener) {
    this.listener = listener;
    this.open();
    setInterval(() => this.flush(), SEND_STEP);
  }

  /** Its number; -1 where nothing is taken any more. */
  state(state: Omit<State, "sequence">): number {
    if (this.key === "" || this.ended) return -1;
    this.unsent.push({ state: { ...state, sequence: this.next } });
    this.soon();
    return this.next++;
  }

  // What the hand does now leaves with this task, not with the next tick of a clock; the server's limit of messages holds all the same.
  private soon(): void {
    if (this.due || performance.now() - this.latest < SEND_STEP) return;
    this.due = true;
    queueMicrotask(() => this.flush());
  }

  command(command: Command): void {
    if (this.key !== "" && !this.ended) this.unsent.push({ command: { sequence: this.next++, command } });
  }

  /** Events that the server has not acknowledged. */
  get waiting(): number {
    return this.unsent.length;
  }

  /** Closes the socket as a lost network would; the page comes back by itself. */
  drop(): void {
    this.socket?.close();
  }

  end(): void {
    this.ended = true;
  }

  private open(): void {
    const query = new URLSearchParams(location.search);
    if (this.key !== "") query.set("key", this.key);
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/session?${query}`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (event.data instanceof ArrayBuffer) this.listener.binary(event.data);
      else this.take(JSON.parse(event.data) as ServerMessage);
    };
    socket.onclose = (event) => {
      this.welcomed = false;
      if (this.ended) return;
      const occupied = event.code === OCCUPIED;
      if (occupied) this.listener.occupied();
      else this.listener.connected(false);
      setTimeout(() => this.open(), occupied ? OCCUPIED_RETRY : RETRY);
    };
  }

  private take(message: ServerMessage): void {
    if (message.type === "welcome" || message.type === "watching") {
      // A page that is new goes on where the session is; one that comes back drops what has arrived.
      if (this.key === "") this.next = message.next_sequence;
      else if (this.key !== message.key) location.reload();
      this.key = message.key;
      this.acknowledge(message.next_sequence);
      this.sent = 0;
      this.left = [];
      this.welcomed = true;
      this.listener.connected(true);
    } else if (message.type === "ack") {
      const left = this.left.shift();
      if (left !== undefined && this.roundTrips.push(performance.now() - left) > 2000) this.roundTrips.shift();
      this.acknowledge(message.next_sequence);
    }
    this.listener.message(message);
  }

  private acknowledge(next: number): void {
    const arrived = Math.max(0, Math.min(this.unsent.length, next - (this.next - this.unsent.length)));
    this.unsent.splice(0, arrived);
    this.sent = Math.max(0, this.sent - arrived);
    // The server answers every message, in order. An answer with nothing new means that one was dropped: when the answers to all others
    // have come, what the server lacks is sent again.
    this.stalled ||= arrived === 0 && this.sent > 0;
    if (--this.answers <= 0) {
      this.answers = 0;
      this.sent = 0;
      this.stalled = false;
    }
  }

  private flush(): void {
    this.due = false;
    const socket = this.socket;
    if (!this.welcomed || !socket || socket.readyState !== WebSocket.OPEN) {
      this.answers = 0;
      return;
    }
    if (this.stalled) return;
    const events = this.unsent.slice(this.sent, this.sent + MOST_EVENTS);
    if (events.length === 0) return;
    socket.send(JSON.stringify({ events }));
    this.sent += events.length;
    this.answers++;
    this.latest = performance.now();
    this.left.push(this.latest);
    this.listener.sent(this.next - this.unsent.length + this.sent);
  }
}
