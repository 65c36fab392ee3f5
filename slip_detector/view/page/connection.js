// The connection to slip_view: messages by type, frames, and requests.

// Frames come many times a second: after so many checks without one, slip_view counts as hung.
const AGAIN_MS = 1000, CHECK_MS = 1000, MOST_CHECKS = 3;
// The least age, in seconds, of what is shown at which the page says how old it is.
const OLD_S = 2;
const UNREACHABLE = 'slip_view cannot be reached';

// Return a binary frame, which view_request.py makes, as {header, arrays}: the arrays by name.
export function readFrame(buffer) {
  const length = new DataView(buffer).getUint32(0, true), arrays = {};
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let place = 4 + length;
  for (const [name, shape] of header.arrays) {
    arrays[name] = new Float32Array(buffer, place, shape.reduce((product, n) => product * n, 1));
    place += arrays[name].byteLength;
  }
  return {header, arrays};
}

export class Connection extends EventTarget {
  constructor() {
    super();
    Object.assign(this, {words: null, checks: 0, requests: 0, answers: new Map(), view: {}});
    // Whether a frame waits to be drawn; when it was asked for, and when the shown one was.
    this.draws = false;
    this.askedMs = this.shownMs = NaN;
    listen(document, 'visibilitychange', () => this.sendView());
    setInterval(() => this.checkForFrames(), CHECK_MS);
  }

  emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, {detail}));
  }

  say(words) {
    if (words === this.words) return;
    this.words = words;
    this.emit('state', words);
  }

  // Count checks without a frame, if frames are due and none waits to be drawn.
  checkForFrames() {
    const due = this.isOpen && !document.hidden && this.view.fingers?.length;
    this.checks = due && !this.draws ? this.checks + 1 : 0;
    if (this.checks > MOST_CHECKS) this.say('slip_view does not answer');
    if (!due) this.shownMs = NaN;
    const seconds = Math.floor((performance.now() - this.shownMs) / 1000);
    this.emit('age', seconds >= OLD_S ? `, shown is ${seconds}\u00a0s old` : '');
  }

  get isOpen() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  // Let take(message) be called with each message of this type, with a 'frame' when the browser
  // draws, with a 'state', why there is no connection, or '', and with an 'age' of what is old.
  on(type, take) {
    listen(this, type, ({detail}) => take(detail));
  }

  open() {
    const address = new URL('/live', location.href);
    address.protocol = address.protocol.replace('http', 'ws');
    address.search = location.search;
    const socket = this.socket = new WebSocket(address);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.say('');
      this.sendView();
    };
    socket.onmessage = ({data}) => this.take(data);
    socket.onclose = ({reason}) => {
      const refusal = 'the connection to slip_view was lost';
      for (const resolve of this.answers.values()) resolve({refusal});
      this.answers.clear();
      this.explain(reason);
      setTimeout(() => this.open(), AGAIN_MS);
    };
  }

  async explain(reason) {
    // A WebSocket does not pass on why the server refuses it.
    const why = reason || await fetch(`/live${location.search}`)
      .then((answer) => (answer.status === 403 ? answer.text() : '')).catch(() => '');
    if (!this.isOpen) this.say(`${why.trim() || UNREACHABLE}; trying again`);
  }

  take(data) {
    if (typeof data !== 'string') {
      this.checks = 0;
      this.say('');
      this.draws = true;
      requestAnimationFrame(() => this.draw(data));
      return;
    }
    const message = JSON.parse(data);
    if (message.type === 'answer') {
      this.answers.get(message.id)?.(message);
      this.answers.delete(message.id);
    }
    this.emit(message.type, message);
  }

  draw(data) {
    this.draws = false;
    if (!this.isOpen) return;
    // The next frame is made while this one is drawn.
    this.send({type: 'drawn'});
    [this.shownMs, this.askedMs] = [this.askedMs, performance.now()];
    this.emit('frame', readFrame(data));
  }

  // Change some of what the page asks for.
  changeView(changes) {
    const before = JSON.stringify(this.view);
    Object.assign(this.view, changes);
    if (JSON.stringify(this.view) !== before) this.sendView();
  }

  sendView() {
    this.askedMs = performance.now();
    this.send({type: 'view', ...(document.hidden ? {} : this.view)});
  }

  // Send a request; resolves with the answer, whose refusal is '' or says why not.
  request(type, content = {}) {
    if (!this.isOpen) return Promise.resolve({refusal: UNREACHABLE});
    const id = ++this.requests;
    return new Promise((resolve) => {
      this.answers.set(id, resolve);
      this.send({...content, type, id});
    });
  }

  send(message) {
    if (this.isOpen) this.socket.send(JSON.stringify(message));
  }
}
