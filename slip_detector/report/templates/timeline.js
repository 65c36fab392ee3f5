// A timeline: lanes from top to bottom over one axis of time. uPlot draws the axis and the curves,
// shows where the pointer is, and lets the user select an interval; the page itself paints what is
// not a curve, such as a decision that is ON or OFF.
//
// Times are seconds. Positions are CSS pixels from the upper left corner of the timeline.

const AXIS_HEIGHT = 22, NAMES_WIDTH = 92, RIGHT_MARGIN = 16;
const CURVE = '#3d5a73', CURVE_RANGE = '#9db3c5', GRID = '#dfe3e6', TEXT = '#23292e';

// Seconds from tick to tick: 1, 2 and 5 times powers of ten below a second, then those of a clock.
const TICKS_S = [
  ...[1e-4, 1e-3, 1e-2, 1e-1].flatMap((power) => [power, 2 * power, 5 * power]),
  1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 36000, 86400, 864000,
];

// Keys that move the interval, by shares of it, and keys that zoom, by factors.
const MOVES = {ArrowLeft: -0.1, ArrowRight: 0.1, PageUp: -0.9, PageDown: 0.9}, ZOOMS = {'+': 0.5, '=': 0.5, '-': 2};
// With Shift, keys that move the pointer: to the right by a share of the interval, down by lanes.
const POINTS = {ArrowLeft: [-0.01, 0], ArrowRight: [0.01, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};

class Timeline {
  // tickText(seconds, digits): the text at a tick, with so many digits after the point.
  // onInterval(from, to, how): the user wants to see another interval; how: 'zoom', 'move', 'choose', or
  // 'whole', with from -Infinity and to Infinity.
  // onPoint(seconds, lane): the pointer, or keys, have moved to this place; null: it has left.
  // The buttons of the page with the ids zoom-in and zoom-out zoom.
  constructor(root, {tickText, onInterval, onPoint}) {
    Object.assign(this, {root, tickText, onInterval, onPoint});
    this.lanes = [];
    this.names = build('div.lane-names');
    root.append(this.names);
    root.addEventListener('dblclick', () => onInterval(-Infinity, Infinity, 'whole'));
    root.addEventListener('keydown', (event) => this.onKey(event));
    for (const kind of ['pointerleave', 'blur']) root.addEventListener(kind, () => this.point(null));
    for (const [id, factor] of [['zoom-in', 0.5], ['zoom-out', 2]]) element(id).addEventListener('click', () => this.zoom(factor));
  }

  // The time at the place that is pointed at, in seconds, or null; it changes while the drawing scrolls.
  get pointed() {
    return this.pointedShare === undefined ? null : this.from + this.pointedShare * (this.to - this.from);
  }

  point(seconds, lane) {
    this.pointedShare = seconds === null ? undefined : (seconds - this.from) / (this.to - this.from);
    this.pointedLane = lane;
    if (seconds === null) this.plot?.setCursor({left: -10, top: -10});
    this.onPoint(seconds, lane);
  }

  zoom(factor, at = (this.from + this.to) / 2) {
    if (this.plot) this.onInterval(at - (at - this.from) * factor, at + (this.to - at) * factor, 'zoom');
  }

  move(share) {
    const by = share * (this.to - this.from);
    this.onInterval(this.from + by, this.to + by, 'move');
  }

  // Move the cursor as if the pointer moved, beginning near the end of the first lane with a curve.
  pointElsewhere([share, down]) {
    const {lanes, plot} = this, before = lanes.indexOf(this.pointedLane);
    const lane = lanes[before < 0 ? lanes.findIndex(({curve}) => curve) : Math.min(Math.max(before + down, 0), lanes.length - 1)];
    const at = Math.min(Math.max((this.pointedShare ?? 0.9) + share, 0), 1), seconds = this.from + at * (this.to - this.from);
    plot.setCursor({left: plot.valToPos(seconds, 'x'), top: lane.top + lane.height / 2 - AXIS_HEIGHT});
    this.point(seconds, lane);
  }

  onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.plot) return;
    const {key, shiftKey} = event;
    if (shiftKey && key in POINTS) this.pointElsewhere(POINTS[key]);
    else if (!shiftKey && key in MOVES) this.move(MOVES[key]);
    else if (key in ZOOMS) this.zoom(ZOOMS[key]);
    else if (key === 'Home') this.onInterval(-Infinity, Infinity, 'whole');
    else return;
    event.preventDefault();
  }

  // Set the lanes from top to bottom: {name, note, kind, height, curve, colors, below, paint, paintAbove}.
  // curve: the number of the lane's curves, true for one. colors: those of its curves, if they are
  // not the usual one. below: pixels that stay free under the curves. paint(pen, lane): paints the
  // rest, under the curves, paintAbove(pen, lane) what is above them, with pen.context; pen.xOf(seconds), pen.right, lane.top and lane.height
  // are in pixels.
  setLanes(lanes) {
    let top = AXIS_HEIGHT;
    for (const lane of lanes) {
      lane.top = top;
      top += lane.height + (lane.curve ? 0 : 2);
    }
    const alike = (lane, i) => ['height', 'curve', 'colors'].every(
      (part) => String(lane[part]) === String(this.lanes[i][part]));
    if (lanes.length !== this.lanes.length || !lanes.every(alike)) {
      this.plot?.destroy();
      this.plot = null;
    }
    // A new description of the same lanes, as after each change, does not take the pointer away.
    this.pointedLane = lanes.find(({name}) => name === this.pointedLane?.name);
    if (!this.pointedLane) this.pointedShare = undefined;
    this.lanes = lanes;
    this.height = top;
    this.names.replaceChildren(...lanes.map((lane) => {
      const name = build('div.lane-name', lane.name);
      if (lane.kind) name.classList.add(lane.kind);
      Object.assign(name.style, {top: `${lane.top}px`, height: `${lane.height}px`});
      // The colour of a single curve is shown beside the name.
      if (lane.colors?.length === 1) name.style.boxShadow = `inset 4px 0 ${lane.colors[0]}`;
      if (lane.note && lane.height >= 26) name.append(build('small', lane.note));
      return name;
    }));
  }

  // The lane of each curve, from top to bottom, and the number of the curve in its lane.
  curveLanes() {
    return this.lanes.flatMap((lane) => Array.from({length: Number(lane.curve ?? 0)}, (_, i) => ({lane, i})));
  }

  // Draw an interval of time. x: rising times. curves: those of all lanes, in order, as
  // {rows, low, high, range}. rows: samples, joined by a line. low, high: the lowest and the highest
  // values from each time to the next. All are null where there are none. range: the values at the
  // bottom and the top of the lane. steps: whether low and high are drawn as steps; where a step is
  // hardly wider than a pixel, lines do. joined: values so many seconds apart are joined by a line
  // although there are none in between. paint(pen): paints what lies under all lanes.
  draw({from, to, x, curves, steps = false, joined = 0, paint}) {
    Object.assign(this, {from, to, steps, joined, paintUnderAll: paint});
    const data = [x, ...curves.flatMap(({rows, low, high}) => [high, low, rows])];
    const width = this.root.clientWidth;
    this.plot ??= new uPlot(this.options(width), data, this.root);
    if (this.plot.width !== width) this.plot.setSize({width, height: this.height});
    const lanes = this.curveLanes();
    this.plot.batch(() => {
      this.plot.setData(data, false);
      this.plot.setScale('x', {min: from, max: to});
      curves.forEach(({range: [low, high]}, i) => {
        // uPlot's scale spans the whole height, of which the lane is a part.
        const {lane} = lanes[i], top = lane.top + 1, bottom = lane.top + lane.height - lane.below;
        const unit = (high - low) / (bottom - top);
        this.plot.setScale(`lane-${i}`, {
          min: low - unit * (this.height - bottom), max: high + unit * (top - AXIS_HEIGHT),
        });
      });
    });
  }

  options(width) {
    const stepped = uPlot.paths.stepped({align: 1, alignGaps: 1}), linear = uPlot.paths.linear({alignGaps: 1});
    const paths = (...stretch) => (this.steps ? stepped : linear)(...stretch);
    const gaps = (plot, i, first, last, found) => {
      const joined = this.joined / (this.to - this.from) * plot.bbox.width;
      return found.filter(([start, stop]) => stop - start > joined);
    };
    const series = [{}], scales = {x: {time: false, auto: false}}, bands = [];
    this.curveLanes().forEach(({lane, i: k}, i) => {
      const stroke = lane.colors?.[k] ?? CURVE;
      const curve = {scale: `lane-${i}`, auto: false, stroke, width: 1, points: {show: false}, gaps};
      scales[curve.scale] = {auto: false, range: [0, 1]};
      bands.push({series: [series.length, series.length + 1], fill: lane.colors ? `${stroke}70` : CURVE_RANGE});
      series.push({...curve, paths}, {...curve, paths},
        // A sample is drawn as a dot where there is room, or where it has no neighbour.
        {...curve, pxAlign: 0, points: {size: 4, space: 9, fill: stroke, filter: lonely}});
    });
    return {
      width, height: this.height, series, scales, bands,
      padding: [0, RIGHT_MARGIN, 0, NAMES_WIDTH],
      legend: {show: false},
      axes: [{
        side: 0, size: AXIS_HEIGHT, gap: 1, space: 90, incrs: TICKS_S, stroke: TEXT,
        font: '12px system-ui, sans-serif', grid: {stroke: GRID, width: 1}, ticks: {show: false},
        values: (_, splits, axis, space, step) => {
          const digits = step >= 1 ? 0 : Math.min(3, Math.ceil(-Math.log10(step) - 1e-9));
          return splits.map((seconds) => this.tickText(seconds, digits));
        },
      }],
      cursor: {
        y: false, points: {show: false}, drag: {x: true, y: false, setScale: false},
        bind: {
          mousedown: (plot, target, choose) => (event) => event.shiftKey && choose(event),
          dblclick: () => null,
        },
      },
      hooks: {
        ready: [(plot) => this.listen(plot)],
        drawClear: [(plot) => this.withPen(plot, (pen) => {
          pen.context.fillStyle = '#fff';
          pen.context.fillRect(pen.left, pen.top, pen.right - pen.left, pen.bottom - pen.top);
          this.paintUnderAll(pen);
        })],
        drawAxes: [(plot) => this.withPen(plot, (pen) => this.lanes.forEach((lane) => lane.paint?.(pen, lane)))],
        draw: [(plot) => this.withPen(plot, (pen) => this.lanes.forEach((lane) => lane.paintAbove?.(pen, lane)))],
        setSelect: [(plot) => {
          const {left, width: chosen} = plot.select;
          plot.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
          if (chosen > 3) this.onInterval(plot.posToVal(left, 'x'), plot.posToVal(left + chosen, 'x'), 'choose');
        }],
      },
    };
  }

  withPen(plot, paint) {
    const {ctx: context, bbox} = plot, scale = bbox.width / plot.over.clientWidth || 1;
    context.save();
    context.beginPath();
    context.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    context.clip();
    context.scale(scale, scale);
    paint({
      context, left: NAMES_WIDTH, right: NAMES_WIDTH + bbox.width / scale, top: AXIS_HEIGHT, bottom: this.height,
      xOf: (seconds) => plot.valToPos(seconds, 'x') + NAMES_WIDTH,
    });
    context.restore();
  }

  // Let the wheel zoom at the pointer, and dragging move the interval.
  listen(plot) {
    const {over} = plot;
    const under = (event) => {
      const box = this.root.getBoundingClientRect(), y = event.clientY - box.top;
      return [
        plot.posToVal(event.clientX - box.left - NAMES_WIDTH, 'x'),
        this.lanes.find((lane) => y >= lane.top && y < lane.top + lane.height + 2),
      ];
    };
    over.addEventListener('wheel', (event) => {
      event.preventDefault();
      const unit = event.deltaMode === 1 ? 30 : 1;
      if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) this.move(event.deltaX * unit / 1000);
      else this.zoom(Math.exp(event.deltaY * unit * 0.002), under(event)[0]);
    }, {passive: false});
    let grip = null;
    over.addEventListener('pointerdown', (event) => {
      if (event.button || event.shiftKey) return;
      over.setPointerCapture(event.pointerId);
      grip = {x: event.clientX, from: this.from, to: this.to, moved: false};
    });
    over.addEventListener('pointermove', (event) => {
      this.point(...under(event));
      if (!grip) return;
      grip.moved ||= Math.abs(event.clientX - grip.x) > 3;
      const shift = (grip.x - event.clientX) * (grip.to - grip.from) / over.clientWidth;
      if (grip.moved) this.onInterval(grip.from + shift, grip.to + shift, 'move');
      over.classList.toggle('moving', grip.moved);
    });
    const release = () => {
      grip = null;
      over.classList.remove('moving');
    };
    for (const kind of ['pointerup', 'pointercancel']) over.addEventListener(kind, release);
  }
}

// The places of samples without neighbours, which no line shows.
function lonely(plot, i, show, gaps) {
  if (show || !gaps?.length) return null;
  const values = plot.data[i], [first, last] = plot.series[0].idxs, all = Array.from({length: last - first + 1}, (_, k) => first + k);
  return all.filter((k) => values[k] != null && values[k - 1] == null && values[k + 1] == null);
}
