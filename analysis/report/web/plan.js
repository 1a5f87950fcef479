// Top-view drawings, in metres: x to the right, y up.

/** Asks every player and map of the page to draw itself anew, as the screen is another. */
function fitAll() {
  document.querySelectorAll("[data-player], [data-map]")
    .forEach((root) => root.dispatchEvent(new CustomEvent("fit")));
}

for (const query of ["(prefers-color-scheme: dark)", "print"]) {
  matchMedia(query).addEventListener("change", fitAll);
}
addEventListener("resize", fitAll);

/** Maps metres to the pixels of a canvas: `across` metres fit into its shorter side. */
function viewOf(canvas, x, y, across) {
  const scale = Math.min(canvas.width, canvas.height) / across;
  return {
    scale,
    at: (px, py) => [canvas.width / 2 + (px - x) * scale, canvas.height / 2 - (py - y) * scale],
  };
}

function tracePolygon(context, view, vertices) {
  vertices.forEach(([x, y], i) => {
    const [px, py] = view.at(x, y);
    if (i) context.lineTo(px, py);
    else context.moveTo(px, py);
  });
  context.closePath();
}

/** Fills all points within `radius` of a convex polygon or a single point. */
function fillShape(context, view, shape, fill, edge, line) {
  const grow = shape.radius * view.scale;
  context.lineJoin = context.lineCap = "round";
  context.beginPath();
  tracePolygon(context, view, shape.vertices);
  if (shape.vertices.length === 1) {
    const [px, py] = view.at(...shape.vertices[0]);
    context.beginPath();
    context.arc(px, py, grow, 0, 2 * Math.PI);
  } else if (grow > 0) {
    context.lineWidth = 2 * (grow + line);
    context.strokeStyle = edge;
    context.stroke();
    context.lineWidth = 2 * grow;
    context.strokeStyle = fill;
    context.stroke();
  }
  context.fillStyle = fill;
  context.fill();
  if (grow > 0 && shape.vertices.length > 1) return;
  context.lineWidth = line;
  context.strokeStyle = edge;
  context.stroke();
}

/** Draws grid lines every `step` metres. */
function drawGrid(context, canvas, view, step, colour) {
  const [x0, y0] = view.at(0, 0);
  const gap = step * view.scale;
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.beginPath();
  for (let x = x0 % gap; x < canvas.width; x += gap) {
    context.moveTo(Math.round(x) + 0.5, 0);
    context.lineTo(Math.round(x) + 0.5, canvas.height);
  }
  for (let y = y0 % gap; y < canvas.height; y += gap) {
    context.moveTo(0, Math.round(y) + 0.5);
    context.lineTo(canvas.width, Math.round(y) + 0.5);
  }
  context.stroke();
}

/** Draws a labelled bar of `metres` in the lower left corner. */
function drawScale(context, canvas, view, metres, look, ratio) {
  const x = 12 * ratio, y = canvas.height - 12 * ratio, long = metres * view.scale;
  const text = `${metres} m`;
  context.font = `${12 * ratio}px system-ui, sans-serif`;
  context.fillStyle = look.paper;
  context.fillRect(x - 5 * ratio, y - 20 * ratio,
    Math.max(long, context.measureText(text).width) + 10 * ratio, 25 * ratio);
  context.fillStyle = look.ink;
  context.fillRect(x, y, long, 2 * ratio);
  context.fillText(text, x, y - 5 * ratio);
}

/** Draws the waypoints with their acceptance circles, and home. */
function drawCourse(context, view, course, reached, look, ratio) {
  context.font = `${11 * ratio}px system-ui, sans-serif`;
  context.textAlign = "center";
  course.waypoints.forEach(([x, y], i) => {
    const [px, py] = view.at(x, y);
    context.beginPath();
    context.arc(px, py, course.acceptance_m * view.scale, 0, 2 * Math.PI);
    context.lineWidth = ratio;
    context.strokeStyle = look.ink;
    context.setLineDash([4 * ratio, 3 * ratio]);
    context.stroke();
    context.setLineDash([]);
    const done = reached.includes(i);
    context.fillStyle = look.ink;
    context.fillText(done ? `${i + 1} ✓` : `${i + 1}`, px, py + 4 * ratio);
  });
  const [px, py] = view.at(...course.home);
  context.font = `${16 * ratio}px system-ui, sans-serif`;
  context.fillText("★", px, py + 6 * ratio);
  context.textAlign = "start";
}

/** Draws points `from` to `to` of a path, one line for each stretch of one colour. */
function drawPath(context, view, mission, from, to, colourOf, line) {
  context.lineWidth = line;
  context.lineJoin = context.lineCap = "round";
  let i = from;
  while (i < to) {
    const colour = colourOf(i);
    context.beginPath();
    context.moveTo(...view.at(mission.x[i], mission.y[i]));
    do {
      i += 1;
      context.lineTo(...view.at(mission.x[i], mission.y[i]));
    } while (i < to && colourOf(i) === colour);
    context.strokeStyle = colour;
    context.stroke();
  }
}

function drawCross(context, px, py, size, colour, line) {
  context.beginPath();
  context.moveTo(px - size, py - size);
  context.lineTo(px + size, py + size);
  context.moveTo(px + size, py - size);
  context.lineTo(px - size, py + size);
  context.strokeStyle = colour;
  context.lineWidth = line;
  context.stroke();
}

/** Transforms a point from the robot's frame to the world's. */
function toWorld(pose, x, y) {
  const cos = Math.cos(pose.yaw), sin = Math.sin(pose.yaw);
  return [pose.x + cos * x - sin * y, pose.y + sin * x + cos * y];
}

function drawRobot(context, view, pose, parts, look, line) {
  for (const part of parts) {
    const vertices = part.vertices.map(([x, y]) => toWorld(pose, x, y));
    const fill = part.wheel ? look.wheel : look.body;
    fillShape(context, view, { vertices, radius: part.radius }, fill, look.ink, line);
  }
}

/** Draws another robot in its colour, with its path so far and its name. */
function drawAgent(context, view, path, last, time, { name, parts }, colour, look, ratio) {
  const pose = poseAt(path, last, time), [px, py] = view.at(pose.x, pose.y);
  context.setLineDash([7 * ratio, 4 * ratio]);
  drawPath(context, view, path, 0, last, () => colour, 2 * ratio);
  context.setLineDash([]);
  drawRobot(context, view, pose, parts, { ...look, body: colour }, ratio);
  context.font = `${12 * ratio}px system-ui, sans-serif`;
  context.lineWidth = 3 * ratio;
  context.strokeStyle = look.paper;
  context.strokeText(name, px + 10 * ratio, py - 10 * ratio);
  context.fillStyle = look.ink;
  context.fillText(name, px + 10 * ratio, py - 10 * ratio);
}

/** Draws a walker as a disc. */
function drawWalker(context, view, walker, last, time, colour, look, ratio) {
  const { x, y } = poseAt(walker, last, time);
  fillShape(context, view, { vertices: [[x, y]], radius: walker.radius }, colour, look.ink, ratio);
}

const LINE_RAD = 0.035; // a narrower beam is drawn as a line

/** Draws a narrow beam as a line up to its reading, at which it has a dot. */
function drawRay(context, view, pose, sensor, state, look, ratio) {
  const from = view.at(...toWorld(pose, sensor.x, sensor.y));
  const silent = state.reading === null, yaw = pose.yaw + sensor.yaw;
  const clear = silent || state.reading > 0.98 * sensor.range;
  const range = (silent ? 0.2 * sensor.range : state.reading) * sensor.level * view.scale;
  const to = [from[0] + range * Math.cos(yaw), from[1] - range * Math.sin(yaw)];
  const colour = state.failed ? look.silent : look.pairs[sensor.pair % look.pairs.length];
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = (clear ? 1 : 2) * ratio;
  if (silent) context.setLineDash([4 * ratio, 4 * ratio]);
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...to);
  context.stroke();
  context.setLineDash([]);
  if (clear) return;
  context.beginPath();
  context.arc(...to, 3 * ratio, 0, 2 * Math.PI);
  context.fill();
}

/** Draws a sensor's cone up to its reading, or to that of each sector, projected to the ground. */
function drawCone(context, view, pose, sensor, state, look, ratio) {
  if (sensor.fov < LINE_RAD) {
    drawRay(context, view, pose, sensor, state, look, ratio);
    return;
  }
  const [px, py] = view.at(...toWorld(pose, sensor.x, sensor.y));
  const middle = pose.yaw + sensor.yaw, half = sensor.fov / 2;
  const colour = state.failed ? look.silent : look.pairs[sensor.pair % look.pairs.length];
  const silent = state.reading === null;
  const clear = silent || state.reading > 0.98 * sensor.range;
  const sectors = state.sectors || [state.reading], width = sensor.fov / sectors.length;
  const arcs = () => sectors.forEach((_, k) => { // from the left edge on, as canvas turns
    const reading = sectors[sectors.length - 1 - k];
    const range = (reading === null ? 0.2 * sensor.range : reading) * sensor.level * view.scale;
    const left = -middle - half + k * width;
    context.arc(px, py, range, left, left + width);
  });
  context.beginPath();
  context.moveTo(px, py);
  arcs();
  context.closePath();
  context.globalAlpha = clear ? 0.1 : 0.28;
  context.fillStyle = colour;
  context.fill();
  context.globalAlpha = 1;
  context.strokeStyle = colour;
  if (silent) context.setLineDash([4 * ratio, 4 * ratio]);
  else context.beginPath();
  arcs();
  context.lineWidth = (clear ? 1 : 2.5) * ratio;
  context.stroke();
  context.setLineDash([]);
}

/** Draws the place of a sensor. */
function drawSensor(context, view, pose, sensor, state, look, ratio) {
  context.beginPath();
  context.arc(...view.at(...toWorld(pose, sensor.x, sensor.y)), 4 * ratio, 0, 2 * Math.PI);
  context.fillStyle = state.failed ? look.silent : look.pairs[sensor.pair % look.pairs.length];
  context.fill();
  context.lineWidth = ratio;
  context.strokeStyle = look.paper;
  context.stroke();
}

/** Crosses out a sensor whose readings have ended; puts a ring around one that errs. */
function markFault(context, px, py, size, fault, look, ratio) {
  if (fault === null) return;
  if (endsReadings(fault)) {
    drawCross(context, px, py, size, look.paper, 5 * ratio);
    drawCross(context, px, py, size, look.ink, 2.5 * ratio);
    return;
  }
  for (const [colour, line] of [[look.paper, 4], [look.hit, 2]]) {
    context.beginPath();
    context.arc(px, py, size * (0.6 + 0.6 * fault.share), 0, 2 * Math.PI);
    context.strokeStyle = colour;
    context.lineWidth = line * ratio;
    context.stroke();
  }
}

/** Marks where the robot was when a part failed, and names the part. */
function markPart(context, view, { x, y, part }, look, ratio) {
  const [px, py] = view.at(x, y), size = 6 * ratio;
  context.beginPath();
  context.moveTo(px, py - size);
  for (const [dx, dy] of [[size, 0], [0, size], [-size, 0]]) context.lineTo(px + dx, py + dy);
  context.closePath();
  context.fillStyle = look.hit;
  context.fill();
  context.lineWidth = 1.5 * ratio;
  context.strokeStyle = look.paper;
  context.stroke();
  context.font = `${11 * ratio}px system-ui, sans-serif`;
  context.textBaseline = "middle";
  context.lineWidth = 3 * ratio;
  context.strokeText(part, px + size + 3 * ratio, py);
  context.fillStyle = look.ink;
  context.fillText(part, px + size + 3 * ratio, py);
}

/** Marks a fault at the place of its sensor. */
function drawFault(context, view, pose, sensor, fault, look, ratio) {
  const [px, py] = view.at(...toWorld(pose, sensor.x, sensor.y));
  markFault(context, px, py, 7 * ratio, fault, look, ratio);
}
