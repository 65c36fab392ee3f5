// The connection to slip_view. What the page is told by type of message, frames, and requests.

import {readFrame} from './frames.js';

const AGAIN_MS = 1000;

export class Connection {
  // onState(words): connected ('') or why not.
  constructor(onState) {
    this.onState = onState;
    this.takers = new Map();
    this.drawers = [];
    this.answers = new Map();
    this.requests = 0;
    this.looked = {};
    this.frame = null;
    this.waits = false;
    // A hidden page looks at nothing.
    document.addEventListener('visibilitychange', () => this.sendLook());
  }

  // take(message): called with each message of this type.
  on(type, take) {
    const takers = this.takers.get(type) ?? [];
    takers.push(take);
    this.takers.set(type, takers);
  }

  // draw({header, arrays}): called once for each frame, when the browser draws.
  onFrame(draw) {
    this.drawers.push(draw);
  }

  open() {
    const address = new URL('/live', location.href);
    address.protocol = address.protocol.replace('http', 'ws');
    address.search = location.search;
    const socket = this.socket = new WebSocket(address);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.onState('');
      this.sendLook();
    };
    socket.onmessage = ({data}) => this.take(data);
    socket.onclose = ({reason}) => {
      for (const {resolve} of this.answers.values()) resolve({refusal: 'the connection to slip_view was lost'});
      this.answers.clear();
      this.onState(`${reason || 'slip_view cannot be reached'}; trying again`);
      setTimeout(() => this.open(), AGAIN_MS);
    };
  }

  take(data) {
    if (typeof data !== 'string') {
      this.frame = readFrame(data);
      if (!this.waits) requestAnimationFrame(() => this.draw());
      this.waits = true;
      return;
    }
    const message = JSON.parse(data);
    if (message.type === 'answer') {
      this.answers.get(message.id)?.resolve(message);
      this.answers.delete(message.id);
    }
    for (const take of this.takers.get(message.type) ?? []) take(message);
  }

  draw() {
    this.waits = false;
    const frame = this.frame;
    // The next frame is made while this one is drawn.
    this.send({type: 'drawn', frame: frame.header.frame});
    for (const draw of this.drawers) draw(frame);
  }

  // Change what the page looks at: {fingers, finger, channels, window_s, pixels, spectrum}, of
  // which those that are not given stay.
  look(changes) {
    const before = JSON.stringify(this.looked);
    Object.assign(this.looked, changes);
    if (JSON.stringify(this.looked) !== before) this.sendLook();
  }

  sendLook() {
    this.send({type: 'look', ...(document.hidden ? {} : this.looked)});
  }

  // Ask for something; resolves with the answer, whose refusal is '' or says why not.
  request(type, content = {}) {
    if (this.socket?.readyState !== WebSocket.OPEN) {
      return Promise.resolve({refusal: 'slip_view cannot be reached'});
    }
    const id = ++this.requests;
    return new Promise((resolve) => {
      this.answers.set(id, {resolve});
      this.send({...content, type, id});
    });
  }

  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
