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

class Timeline {
  // root: an empty element.
  // tickText(seconds, step): the text at a tick, where ticks are `step` seconds apart.
  // onLook(from, to, how): the user wants to see another interval; how: 'zoom', 'move', 'choose', or
  // 'whole', with from -Infinity and to Infinity.
  // onPoint(seconds, lane): the pointer has moved to this place.
  // onClick(seconds, lane, reach): the user has clicked at this place; what is up to `reach` seconds
  // away counts as clicked.
  constructor(root, {tickText, onLook, onPoint, onClick}) {
    Object.assign(this, {root, tickText, onLook, onPoint, onClick});
    this.lanes = [];
    this.names = document.createElement('div');
    this.names.className = 'lane-names';
    root.append(this.names);
    root.addEventListener('dblclick', () => onLook(-Infinity, Infinity, 'whole'));
  }

  // Set the lanes from top to bottom: {name, note, className, height, curve, colors, below, paint}.
  // curve: the number of the lane's curves, true for one. colors: those of its curves, if they are
  // not the usual one. below: pixels that stay free under the curves. paint(pen, lane): paints the
  // rest, under the curves, with pen.context; pen.xOf(seconds), pen.right, lane.top and lane.height
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
    this.lanes = lanes;
    this.height = top;
    this.names.replaceChildren(...lanes.map((lane) => {
      const name = document.createElement('div');
      name.className = `lane-name ${lane.className ?? ''}`;
      name.style.top = `${lane.top}px`;
      name.style.height = `${lane.height}px`;
      name.textContent = lane.name;
      // The colour of a single curve is shown beside the name.
      if (lane.colors?.length === 1) name.style.boxShadow = `inset 4px 0 ${lane.colors[0]}`;
      if (lane.note && lane.height >= 26) {
        const note = document.createElement('small');
        note.textContent = lane.note;
        name.append(note);
      }
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
  // hardly wider than a pixel, lines do. paint(pen): paints what lies under all lanes.
  draw({from, to, x, curves, steps, paint}) {
    Object.assign(this, {steps, paintUnderAll: paint});
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

  // Show the cursor at a time in a lane, as if the pointer were there; null hides it.
  showPointer(seconds, lane) {
    this.plot?.setCursor(seconds === null ? {left: -10, top: -10} : {
      left: this.plot.valToPos(seconds, 'x'), top: lane.top + lane.height / 2 - AXIS_HEIGHT,
    });
  }

  options(width) {
    const stepped = uPlot.paths.stepped({align: 1, alignGaps: 1}), linear = uPlot.paths.linear({alignGaps: 1});
    const paths = (...stretch) => (this.steps ? stepped : linear)(...stretch);
    const series = [{}], scales = {x: {time: false, auto: false}}, bands = [];
    this.curveLanes().forEach(({lane, i: k}, i) => {
      const stroke = lane.colors?.[k] ?? CURVE;
      const curve = {scale: `lane-${i}`, auto: false, stroke, width: 1, points: {show: false}};
      scales[curve.scale] = {auto: false, range: [0, 1]};
      bands.push({series: [series.length, series.length + 1], fill: lane.colors ? `${stroke}70` : CURVE_RANGE});
      series.push({...curve, paths}, {...curve, paths},
        // A sample is drawn as a dot where there is room, or where it has no neighbour.
        {...curve, pxAlign: 0, points: {size: 4, space: 9, fill: stroke, filter: lonely}});
    });
    const bind = (act) => () => act;
    return {
      width, height: this.height, series, scales, bands,
      padding: [0, RIGHT_MARGIN, 0, NAMES_WIDTH],
      legend: {show: false},
      axes: [{
        side: 0, size: AXIS_HEIGHT, gap: 1, space: 90, incrs: TICKS_S, stroke: TEXT,
        font: '12px system-ui, sans-serif', grid: {stroke: GRID, width: 1}, ticks: {show: false},
        values: (_, splits, axis, space, step) => splits.map((s) => this.tickText(s, step)),
      }],
      cursor: {
        y: false, points: {show: false}, drag: {x: true, y: false, setScale: false},
        bind: {
          mousedown: (plot, target, choose) => (event) => event.shiftKey && choose(event),
          dblclick: bind(null),
        },
      },
      hooks: {
        ready: [(plot) => this.listen(plot)],
        drawClear: [(plot) => this.withPen(plot, (pen) => this.paintUnderAll(pen))],
        drawAxes: [(plot) => this.withPen(plot, (pen) => this.lanes.forEach((lane) => lane.paint?.(pen, lane)))],
        setSelect: [(plot) => {
          const {left, width: chosen} = plot.select;
          plot.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
          if (chosen > 3) this.onLook(plot.posToVal(left, 'x'), plot.posToVal(left + chosen, 'x'), 'choose');
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
    const view = () => [plot.scales.x.min, plot.scales.x.max];
    const under = (event) => {
      const box = this.root.getBoundingClientRect(), y = event.clientY - box.top;
      return [
        plot.posToVal(event.clientX - box.left - NAMES_WIDTH, 'x'),
        this.lanes.find((lane) => y >= lane.top && y < lane.top + lane.height + 2),
      ];
    };
    plot.over.addEventListener('wheel', (event) => {
      event.preventDefault();
      const unit = event.deltaMode === 1 ? 30 : 1, [from, to] = view();
      if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
        const shift = (to - from) * event.deltaX * unit / 1000;
        this.onLook(from + shift, to + shift, 'move');
      } else {
        const [at] = under(event), factor = Math.exp(event.deltaY * unit * 0.002);
        this.onLook(at - (at - from) * factor, at + (to - at) * factor, 'zoom');
      }
    }, {passive: false});
    let grip = null;
    plot.over.addEventListener('pointerdown', (event) => {
      if (event.button || event.shiftKey) return;
      plot.over.setPointerCapture(event.pointerId);
      grip = {x: event.clientX, view: view(), moved: false};
    });
    plot.over.addEventListener('pointermove', (event) => {
      this.onPoint(...under(event));
      if (!grip) return;
      grip.moved ||= Math.abs(event.clientX - grip.x) > 3;
      const [from, to] = grip.view, shift = (grip.x - event.clientX) * (to - from) / plot.over.clientWidth;
      if (grip.moved) this.onLook(from + shift, to + shift, 'move');
      plot.over.classList.toggle('moving', grip.moved);
    });
    const release = (event) => {
      const [from, to] = view();
      if (grip && !grip.moved && event.type === 'pointerup') {
        this.onClick(...under(event), 8 * (to - from) / plot.over.clientWidth);
      }
      grip = null;
      plot.over.classList.remove('moving');
    };
    plot.over.addEventListener('pointerup', release);
    plot.over.addEventListener('pointercancel', release);
  }
}

// The places of samples without neighbours, which no line shows.
function lonely(plot, i, show, gaps) {
  if (show || !gaps?.length) return null;
  const values = plot.data[i], [first, last] = plot.series[0].idxs, found = [];
  for (let k = first; k <= last; k++) {
    if (values[k] != null && values[k - 1] == null && values[k + 1] == null) found.push(k);
  }
  return found;
}
