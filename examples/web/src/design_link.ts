// The WebSocket of a design: numbered changes out, the design and what it comes to in.
import { PROTOCOL, pictureMessage } from "./design_protocol";
import type { Change, Reply } from "./design_protocol";

const RETRY = 500;
const OCCUPIED = 4001;
const OCCUPIED_RETRY = 3000;
/** Longest message that the program takes, bytes. */
const LONGEST = 64 << 20;

export interface Listener {
  reply(reply: Reply): void;
  binary(data: ArrayBuffer): void;
  connected(open: boolean, why: string): void;
}

export class Link {
  private socket: WebSocket | null = null;
  private key = "";
  private ended = false;
  private next = 1;
  /** The latest change of the design; those that were refused are none. */
  latest = 0;
  private refused = false;
  /** When changes left whose estimate has not come, by their number. */
  private readonly left = new Map<number, number>();
  /** How long first estimates took, milliseconds. */
  readonly times: number[] = [];
  private readonly listener: Listener;

  constructor(listener: Listener) {
    this.listener = listener;
    this.open();
  }

  /** Whether it is on its way. */
  change(change: Change): boolean {
    const designs = change.do !== "write" && change.do !== "end";
    return this.send((number) => JSON.stringify({ number, change }), designs);
  }

  /** Whether a picture is on its way, or why not. */
  picture(name: string, file: ArrayBuffer): string | null {
    if (file.byteLength > LONGEST - 4096) return `${name}: is larger than 64 MB: save it smaller`;
    return this.send((number) => pictureMessage(number, name, file), true) ? null : "not connected: try again";
  }

  /** The first estimate after a change is on the screen. */
  answered(number: number): void {
    const left = this.left.get(number);
    if (left !== undefined) this.times.push(performance.now() - left);
    for (const asked of this.left.keys()) if (asked <= number) this.left.delete(asked);
  }

  private send(message: (number: number) => string | Blob, designs: boolean): boolean {
    if (this.key === "" || this.ended || this.socket?.readyState !== WebSocket.OPEN) return false;
    if (designs) {
      this.latest = this.next;
      this.left.set(this.next, performance.now());
    }
    this.socket.send(message(this.next++));
    return true;
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
      else this.take(JSON.parse(event.data) as Reply);
    };
    socket.onclose = (event) => {
      if (this.ended) return;
      const occupied = event.code === OCCUPIED;
      this.left.clear();
      this.listener.connected(false, occupied ? "another person is here: this page waits" : "connection lost");
      setTimeout(() => this.open(), occupied ? OCCUPIED_RETRY : RETRY);
    };
  }

  private take(reply: Reply): void {
    if (reply.type === "hello") {
      if (reply.protocol !== PROTOCOL || (this.key !== "" && this.key !== reply.key)) return location.reload();
      this.key = reply.key;
      this.listener.connected(true, "connected");
    }
    if (reply.type === "error") this.refused = true;
    if (reply.type === "state") {
      // A page that is new goes on where the design is.
      this.next = Math.max(this.next, reply.number + 1);
      if (this.refused) {
        [this.refused, this.latest] = [false, reply.number];
        this.left.clear();
      }
    }
    if (reply.type === "ended") this.ended = true;
    this.listener.reply(reply);
  }
}
