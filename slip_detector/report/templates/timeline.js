// A timeline: lanes over one axis of time, in seconds. It draws axis and curves, shows where the
// pointer is, and lets the user zoom, move and select; the page itself paints what is no curve.

const AXIS_HEIGHT = 22, NAMES_WIDTH = 92, RIGHT_MARGIN = 16, TICK_SPACE = 90;
const CURVE = '#3d5a73', GRID = '#dfe3e6', TEXT = '#23292e', FONT = 'system-ui, sans-serif';

// Keys that move the interval, by shares of it, and keys that zoom, by factors.
const MOVES = {ArrowLeft: -0.1, ArrowRight: 0.1, PageUp: -0.9, PageDown: 0.9};
const ZOOMS = {'+': 0.5, '=': 0.5, '-': 2};
// With Shift, keys that move the pointer: to the right by a share of the interval, down by lanes.
const POINTS = {ArrowLeft: [-0.01, 0], ArrowRight: [0.01, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};

class Timeline {
  // onInterval(from, to, how): the user wants to see another interval; how: 'zoom', 'move',
  // or 'whole', which is infinite. onPoint(seconds, lane): pointer or keys have moved here; null:
  // the pointer has left. margin: pixels at the right of the lanes.
  constructor(root, {tickText, onInterval, onPoint, margin = RIGHT_MARGIN}) {
    Object.assign(this, {root, tickText, onInterval, onPoint, margin});
    this.lanes = [];
    this.names = build('div.lane-names');
    this.cursor = build('div.cursor', {hidden: true});
    this.over = build('div.over', this.cursor, {style: `right: ${margin}px`});
    this.canvas = build('canvas');
    root.append(this.canvas, this.names, this.over);
    this.listen();
    listen(root, 'dblclick', () => onInterval(-Infinity, Infinity, 'whole'));
    listen(root, 'keydown', (event) => this.onKey(event));
    listen(root, 'pointerleave blur', () => this.point(null));
    listen('zoom-in', 'click', () => this.zoom(0.5));
    listen('zoom-out', 'click', () => this.zoom(2));
  }

  // The time that is pointed at, in seconds, or null; it changes while the drawing scrolls.
  get pointed() {
    const {pointedShare: share, from, to} = this;
    return share === undefined ? null : from + share * (to - from);
  }

  point(seconds, lane) {
    const {from, to} = this, share = (seconds - from) / (to - from);
    Object.assign(this, {pointedShare: seconds === null ? undefined : share, pointedLane: lane});
    this.cursor.hidden = seconds === null;
    this.cursor.style.left = `${100 * (this.pointedShare ?? 0)}%`;
    this.onPoint(seconds, lane);
  }

  zoom(factor, at = (this.from + this.to) / 2) {
    const from = at - (at - this.from) * factor, to = at + (this.to - at) * factor;
    if (this.curves) this.onInterval(from, to, 'zoom');
  }

  move(share) {
    const by = share * (this.to - this.from);
    this.onInterval(this.from + by, this.to + by, 'move');
  }

  // Move the cursor as the pointer does, beginning near the end of the first lane with a curve.
  pointElsewhere([share, down]) {
    const {lanes} = this, before = lanes.indexOf(this.pointedLane);
    const next = before < 0 ? lanes.findIndex(({curve}) => curve) : before + down;
    const at = clamp((this.pointedShare ?? 0.9) + share, 0, 1);
    this.point(this.from + at * (this.to - this.from), lanes[clamp(next, 0, lanes.length - 1)]);
  }

  onKey(event) {
    if (isShortcut(event) || !this.curves) return;
    const {key, shiftKey} = event;
    if (shiftKey && key in POINTS) this.pointElsewhere(POINTS[key]);
    else if (!shiftKey && key in MOVES) this.move(MOVES[key]);
    else if (key in ZOOMS) this.zoom(ZOOMS[key]);
    else if (key === 'Home') this.onInterval(-Infinity, Infinity, 'whole');
    else return;
    event.preventDefault();
  }

  // Set the lanes from top to bottom: {name, note, kind, height, curve, colors, below, paint,
  // paintScale}. curve: the number of curves. below: pixels that stay free under the curves.
  // paint(pen, lane) paints the rest, under the curves, paintScale what is beside the lanes.
  setLanes(lanes) {
    let top = AXIS_HEIGHT;
    for (const lane of lanes) {
      lane.top = top;
      top += lane.height + (lane.curve ? 0 : 2);
    }
    // A new description of the same lanes, as after each change, does not take the pointer away.
    this.pointedLane = lanes.find(({name}) => name === this.pointedLane?.name);
    if (!this.pointedLane) this.pointedShare = undefined;
    this.lanes = lanes;
    this.height = top;
    this.canvas.style.height = `${top}px`;
    this.names.replaceChildren(...lanes.map((lane) => {
      const name = build('div.lane-name', lane.name);
      if (lane.kind) name.classList.add(lane.kind);
      Object.assign(name.style, {top: `${lane.top}px`, height: `${lane.height}px`});
      if (lane.colors?.length === 1) name.style.boxShadow = `inset 4px 0 ${lane.colors[0]}`;
      if (lane.note && lane.height >= 26) name.append(build('small', lane.note));
      return name;
    }));
  }

  // Draw an interval: at the times x the curves of all lanes, {low, high, range}, with null where
  // nothing is; range: the values at bottom and top. paint(pen) paints what lies under all lanes.
  draw({from, to, x, curves, paint}) {
    Object.assign(this, {from, to, curves});
    const {context, width} = fitted(this.canvas), {height} = this;
    const right = width - this.margin, top = AXIS_HEIGHT;
    const xOf = (seconds) => NAMES_WIDTH + (seconds - from) / (to - from) * (right - NAMES_WIDTH);
    const pen = {context, xOf, left: NAMES_WIDTH, right, top, bottom: height};
    const tick_s = TICK_SPACE * (to - from) / (right - NAMES_WIDTH);
    const {times, digits} = ticksBetween(from, to, tick_s);
    context.textBaseline = 'middle';
    context.save();
    context.rect(NAMES_WIDTH, top, right - NAMES_WIDTH, height);
    context.clip();
    context.fillStyle = '#fff';
    context.fillRect(NAMES_WIDTH, top, right - NAMES_WIDTH, height);
    paint(pen);
    context.fillStyle = GRID;
    for (const seconds of times) context.fillRect(Math.round(xOf(seconds)), top, 1, height);
    const columns = x.map((seconds) => Math.round(xOf(seconds)) + 0.5), rest = curves.values();
    for (const lane of this.lanes) {
      lane.paint?.(pen, lane);
      for (let i = 0; i < Number(lane.curve ?? 0); i++) {
        this.paintCurve(context, columns, lane, rest.next().value, lane.colors?.[i] ?? CURVE);
      }
    }
    context.restore();
    for (const lane of this.lanes) lane.paintScale?.(pen, lane);
    Object.assign(context, {font: `12px ${FONT}`, fillStyle: TEXT, textAlign: 'center'});
    for (const s of times) context.fillText(this.tickText(s, digits), xOf(s), top / 2);
  }

  static yOf({top, height, below}, [least, most], value) {
    return top + 1 + (most - value) / (most - least) * (height - below - 2);
  }

  // A curve is one line: in each column from the lowest to the highest value, and on to the next.
  paintCurve(context, left, lane, {low, high, range}, strokeStyle) {
    const bottom = lane.top + lane.height - lane.below - 1;
    const yOf = (value) => (
      clamp(Math.round(Timeline.yOf(lane, range, value)), lane.top, bottom) + 0.5);
    Object.assign(context, {strokeStyle, lineWidth: 1});
    context.beginPath();
    for (let i = 0; i < low.length; i++) {
      if (low[i] == null) continue;
      const y = yOf(low[i]), top = yOf(high[i]);
      if (low[i - 1] == null) context.moveTo(left[i], y);
      context.lineTo(left[i], y);
      if (top !== y) context.lineTo(left[i], top);
      context.lineTo(left[i + 1] ?? left[i] + 1, top);
    }
    context.stroke();
  }

  // The wheel zooms, dragging moves, two fingers do both.
  listen() {
    const {over} = this, grips = new Map();
    const xOf = (event) => event.clientX - over.getBoundingClientRect().left;
    const timeAt = (x) => this.from + x / over.clientWidth * (this.to - this.from);
    const under = (event) => {
      const y = event.clientY - this.root.getBoundingClientRect().top;
      const isAt = ({top, height}) => y >= top && y < top + height + 2;
      return [timeAt(xOf(event)), this.lanes.find(isAt)];
    };
    listen(over, 'wheel', (event) => {
      event.preventDefault();
      if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) this.move(event.deltaX / 1000);
      else this.zoom(Math.exp(event.deltaY * 0.002), under(event)[0]);
    }, {passive: false});
    let moving = false;
    // When a finger is put down or lifted, all hold what is under them now.
    const hold = (isMoving) => {
      moving = isMoving;
      for (const grip of grips.values()) grip.seconds = timeAt(grip.x);
    };
    listen(over, 'pointerdown', (event) => {
      if (event.button || !this.curves) return;
      over.setPointerCapture(event.pointerId);
      grips.set(event.pointerId, {x: xOf(event)});
      hold(grips.size > 1);
    });
    listen(over, 'pointermove', (event) => {
      if (!this.curves) return;
      this.point(...under(event));
      const grip = grips.get(event.pointerId), x = xOf(event);
      if (!grip || !(moving ||= Math.abs(x - grip.x) > 3)) return;
      grip.x = x;
      const [first, second] = grips.values();
      let span = this.to - this.from;
      if (second) {
        const apart = Math.max(Math.abs(second.x - first.x), 1);
        span = Math.abs(second.seconds - first.seconds) / apart * over.clientWidth;
      }
      const from = first.seconds - first.x / over.clientWidth * span;
      this.onInterval(from, from + span, second ? 'zoom' : 'move');
    });
    listen(over, 'pointerup pointercancel', ({pointerId}) => {
      if (grips.delete(pointerId)) hold(false);
    });
  }
}
