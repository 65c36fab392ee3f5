// The picture of one finger: each taxel at its place, its level as a fill.

const QUIET_FILL = '#e6eaed', LEVEL_FILL = '#74828d', FRAME = '#7a858e', DISABLED_FILL = '#d3d7da';

// Where taxels are drawn, in pixels: for each channel {x, y, side}, x and y of its middle.
// positions: [x, y, z] in metres of each channel, no two the same. The two axes along which the finger
// is largest are shown. margin: pixels that stay free around them.
export function placesOf(positions, width, height, margin = 0) {
  const extents = [0, 1, 2].map((axis) => {
    const along = positions.map((position) => position[axis]);
    const [least, most] = [Math.min(...along), Math.max(...along)];
    return {axis, least, size: most - least};
  });
  const thinnest = extents.reduce((found, extent) => (extent.size <= found.size ? extent : found));
  const [across, along] = extents.filter((extent) => extent !== thinnest);
  const points = positions.map((position) => [across, along].map(({axis, least}) => position[axis] - least));
  const pitch = smallestDistance(points) || Math.max(across.size, along.size) || 1;
  // The outermost taxels have half a pitch to the edge.
  const scale = Math.min((width - 2 * margin) / (across.size + pitch), (height - 2 * margin) / (along.size + pitch));
  const side = Math.min(0.96 * scale * pitch - 1, 56);
  return points.map(([x, y]) => ({
    x: width / 2 + scale * (x - across.size / 2), y: height / 2 - scale * (y - along.size / 2), side,
  }));
}

// The distance of the closest taxels. As these are drawn as squares, the distance of two is the larger
// of those along the axes.
function smallestDistance(points) {
  let smallest = Infinity;
  for (let i = 1; i < points.length; i++) {
    for (let j = 0; j < i; j++) {
      const distance = Math.max(...points[i].map((metres, axis) => Math.abs(metres - points[j][axis])));
      if (distance < smallest) smallest = distance;
    }
  }
  return Number.isFinite(smallest) ? smallest : 0;
}

// How high a level stands in its taxel: 0 at 1/32 of the threshold or less, 1 at the threshold.
export const fillOf = (level) => Math.max(0, Math.min(1, 1 + Math.log2(level) / LEVEL_OCTAVES));

// The content of a picture, as text: while it is the same, nothing has to be painted.
export function pictureOf(places, states, marked) {
  const taxels = states.map(({level, on, valid, disabled}, c) => {
    if (disabled) return 'd';
    if (!valid) return 'x';
    return on ? 'o' : Math.round(2 * places[c].side * fillOf(level));
  });
  return `${taxels} ${[...marked]}`;
}

// Draw all taxels of a finger. states[c]: {level, on, valid, disabled}, level as a ratio to the
// threshold. marked: a set of channels, counted from 1, that are framed.
export function paintFinger(context, places, states, marked) {
  places.forEach((place, c) => {
    paintTaxel(context, place, states[c], c + 1);
    if (marked.has(c + 1)) {
      const {x, y, side} = place, reach = side / 2 + 3;
      context.strokeStyle = '#0072b2';
      context.lineWidth = 2;
      context.setLineDash([3, 2]);
      context.strokeRect(x - reach, y - reach, 2 * reach, 2 * reach);
      context.setLineDash([]);
    }
  });
}

function paintTaxel(context, {x, y, side}, {level, on, valid, disabled}, number) {
  const left = x - side / 2, top = y - side / 2;
  const shape = new Path2D();
  shape.roundRect(left, top, side, side, side / 5);
  context.fillStyle = disabled ? DISABLED_FILL : '#fff';
  context.fill(shape);
  if (!disabled && !valid) {
    context.fillStyle = hatching(context);
    context.fill(shape);
  } else if (!disabled) {
    context.fillStyle = on ? ON : QUIET_FILL;
    context.fill(shape);
    const high = side * fillOf(level);
    if (!on && high > 0) {
      context.save();
      context.clip(shape);
      context.fillStyle = LEVEL_FILL;
      context.fillRect(left, top + side - high, side, high);
      context.restore();
    }
  }
  if (!disabled) {
    context.strokeStyle = on ? '#000' : FRAME;
    context.lineWidth = on ? Math.min(3, Math.max(1.5, side / 8)) : 1;
    context.stroke(shape);
  }
  if (side < 17) return;
  if (!disabled && !valid) cross(context, x, y, side * 0.36);
  const size = Math.min(13, side / 2);
  context.font = `${on ? 700 : 500} ${size}px system-ui, 'DejaVu Sans', sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  // Dark letters with a light outline are legible on any fill; on the colour of ON they need none.
  if (!on) {
    context.strokeStyle = 'rgba(255, 255, 255, 0.92)';
    context.lineWidth = 3.5;
    context.lineJoin = 'round';
    context.strokeText(number, x, y);
  }
  context.fillStyle = disabled ? '#545b61' : '#000';
  context.fillText(number, x, y);
}

function cross(context, x, y, reach) {
  context.strokeStyle = '#8f1111';
  context.lineWidth = 2.5;
  context.beginPath();
  for (const sign of [-1, 1]) {
    context.moveTo(x - reach, y - sign * reach);
    context.lineTo(x + reach, y + sign * reach);
  }
  context.stroke();
}
