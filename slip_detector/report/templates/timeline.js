// A timeline: lanes from top to bottom over one axis of time. uPlot draws the axis and the curves,
// shows where the pointer is, and lets the user choose a stretch; what is not a curve, such as a
// decision that is ON or OFF, the page paints in its lane.
//
// Times are seconds. Pixels are those of CSS, from the upper left corner of the timeline.

const AXIS_HEIGHT = 22, NAMES_WIDTH = 92, RIGHT_MARGIN = 16;
const CURVE = '#3d5a73', CURVE_RANGE = '#9db3c5', GRID = '#dfe3e6', TEXT = '#23292e';

// Seconds from tick to tick: 1, 2 and 5 times powers of ten below a second, then as a clock shows it.
const TICKS_S = [
  ...[1e-4, 1e-3, 1e-2, 1e-1].flatMap((power) => [power, 2 * power, 5 * power]),
  1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 36000, 86400, 864000,
];

class Timeline {
  // root: an empty element.
  // tickText(seconds, step): a time as text beside ticks that are a step apart.
  // onLook(from, to, how): the user wants to see another stretch; how: 'zoom', 'move', 'choose', or
  // 'whole', which is from -Infinity to Infinity.
  // onPoint(seconds, lane): the pointer is there. onClick(seconds, lane, reach): so is a click;
  // reach: how many seconds away from it something may be that is meant.
  constructor(root, {tickText, onLook, onPoint, onClick}) {
    Object.assign(this, {root, tickText, onLook, onPoint, onClick});
    this.lanes = [];
    this.names = document.createElement('div');
    this.names.className = 'lane-names';
    root.append(this.names);
    root.addEventListener('dblclick', () => onLook(-Infinity, Infinity, 'whole'));
  }

  // What is drawn from top to bottom: {name, note, className, height, curve, colors, below, paint}.
  // curve: whether the lane has one, or how many; colors: of each, where it is not the usual one;
  // below: how many pixels the lane leaves free under it. paint(pen, lane): draws the rest with
  // pen.context, under the curve; pen.xOf(seconds) and pen.right are pixels, as are lane.top and
  // lane.height.
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
      // One curve has its colour beside its name.
      if (lane.colors?.length === 1) name.style.boxShadow = `inset 4px 0 ${lane.colors[0]}`;
      if (lane.note && lane.height >= 26) {
        const note = document.createElement('small');
        note.textContent = lane.note;
        name.append(note);
      }
      return name;
    }));
  }

  // The lane of each curve, from top to bottom, and which of the lane's curves it is.
  curveLanes() {
    return this.lanes.flatMap((lane) => Array.from({length: Number(lane.curve ?? 0)}, (_, i) => ({lane, i})));
  }

  // Draw a stretch of time. x: times, rising. curves: those of the lanes that have any, in order:
  // {rows, low, high, range}: samples that are joined by a line, or the lowest and the highest from
  // a time to the next, null where there are none; range: what the lane shows from bottom to top.
  // steps: whether lowest and highest are drawn as steps; lines serve where a step is hardly wider
  // than a pixel. paint(pen): what lies under all lanes.
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
        // The scale of the whole height, of which the lane is a part.
        const {lane} = lanes[i], top = lane.top + 1, bottom = lane.top + lane.height - lane.below;
        const unit = (high - low) / (bottom - top);
        this.plot.setScale(`lane-${i}`, {
          min: low - unit * (this.height - bottom), max: high + unit * (top - AXIS_HEIGHT),
        });
      });
    });
  }

  // Show the line of the pointer at a time, in a lane, as if the pointer were there; null: nowhere.
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
        // A sample is a dot where there is room for it, or no other beside it.
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

  // The wheel zooms at the pointer, dragging moves.
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

// Where a curve's samples have none beside them, so that no line shows them.
function lonely(plot, i, show, gaps) {
  if (show || !gaps?.length) return null;
  const values = plot.data[i], [first, last] = plot.series[0].idxs, found = [];
  for (let k = first; k <= last; k++) {
    if (values[k] != null && values[k - 1] == null && values[k + 1] == null) found.push(k);
  }
  return found;
}
