// The player: chooses the mission and the time, and draws them.

function startPlayer(root) {
  const find = (name) => root.querySelector(`[data-part="${name}"]`);
  const parts = Object.fromEntries(
    ["run", "world", "speed", "course", "close", "readings", "timeline", "play", "scrub", "clock",
      "status", "ended", "key", "nearer", "farther"].map((name) => [name, find(name)]));
  let scripts = [], grounds = {}, shown = null; // shown: the script of the run in the player
  const now = { run: null, mission: null, time: 0, last: 0, across: 3, playing: false };
  let look = null, ground = null, before = null;

  function readColours() {
    const style = getComputedStyle(root);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    const names = ["paper", "ink", "soft", "grid", "obstacle", "edge", "body", "wheel", "silent",
      "hit", "ahead"];
    look = Object.fromEntries(names.map((name) => [name, colour(name)]));
    look.modes = [0, 1, 2, 3, 4].map((i) => colour(`mode${i}`));
    look.pairs = [0, 1, 2, 3, 4, 5, 6].map((i) => colour(`pair${i}`));
  }

  function ratio() {
    return Math.max(1, Math.min(3, window.devicePixelRatio || 1));
  }

  function fit() {
    if (!parts.course.clientWidth) return; // hidden
    const rows = now.run.sensors.length + signalRows(now.run).length;
    parts.readings.style.height = `${Math.max(3, rows) * 32}px`;
    for (const name of ["course", "close", "readings", "timeline"]) {
      const canvas = parts[name];
      canvas.width = Math.round(canvas.clientWidth * ratio());
      canvas.height = Math.round(canvas.clientHeight * ratio());
    }
    readColours();
    drawGround();
    draw();
  }

  function courseView() {
    const [x0, y0, x1, y1] = now.mission.extent;
    const { width, height } = parts.course;
    const scale = Math.min(width / (x1 - x0), height / (y1 - y0));
    return viewOf(parts.course, (x0 + x1) / 2, (y0 + y1) / 2, Math.min(width, height) / scale);
  }

  /** Draws what does not move, once. */
  function drawGround() {
    ground = document.createElement("canvas");
    ground.width = parts.course.width;
    ground.height = parts.course.height;
    const context = ground.getContext("2d"), view = courseView();
    drawGrid(context, ground, view, 1, look.grid);
    for (const shape of now.mission.obstacles) {
      fillShape(context, view, shape, look.obstacle, look.edge, ratio());
    }
    drawPath(context, view, now.mission, 0, now.mission.x.length - 1, () => look.ahead, ratio());
    drawScale(context, ground, view, 2, look, ratio());
  }

  function drawAll(canvas, view, pose, close) {
    const context = canvas.getContext("2d"), mission = now.mission;
    const colourOf = (i) => look.modes[mission.mode[i] % look.modes.length];
    const reached = mission.reached.filter(([at]) => at <= now.time).map(([, corner]) => corner);
    drawCourse(context, view, mission.course, reached, look, ratio());
    drawPath(context, view, mission, 0, now.last, colourOf, (close ? 3 : 2) * ratio());
    mission.agents.forEach((path, i) => drawAgent(context, view, path, now.last, now.time,
      now.run.agents[i], look.pairs[(i + 2) % look.pairs.length], look, ratio()));
    mission.walkers.forEach((walker) => drawWalker(context, view, walker, now.last, now.time,
      look.pairs[1], look, ratio()));
    const states = now.run.sensors.map((_, i) => stateOf(now, i));
    now.run.sensors.forEach((sensor, i) =>
      drawCone(context, view, pose, sensor, states[i], look, ratio()));
    drawRobot(context, view, pose, now.run.parts, look, ratio());
    if (close) {
      now.run.signals.forEach((signal, i) => drawSignal(context, view, pose, signal,
        signalState(now, i), now.run.parts, look, ratio()));
      now.run.sensors.forEach((sensor, i) =>
        drawSensor(context, view, pose, sensor, states[i], look, ratio()));
      now.run.sensors.forEach((sensor, i) =>
        drawFault(context, view, pose, sensor, states[i].fault, look, ratio()));
    }
    for (const fault of mission.parts_failed) {
      if (fault.at_s <= now.time) markPart(context, view, fault, look, ratio());
    }
    for (const { at_s, x, y } of mission.collisions) {
      if (at_s > now.time) continue;
      const [px, py] = view.at(x, y);
      drawCross(context, px, py, 9 * ratio(), look.paper, 6 * ratio());
      drawCross(context, px, py, 9 * ratio(), look.hit, 3 * ratio());
    }
  }

  function draw() {
    const mission = now.mission;
    now.last = recordAt(mission.time, now.time);
    const pose = poseAt(mission, now.last, now.time);
    const plan = parts.course.getContext("2d");
    plan.clearRect(0, 0, parts.course.width, parts.course.height);
    plan.drawImage(ground, 0, 0);
    drawAll(parts.course, courseView(), pose, false);
    const near = parts.close.getContext("2d");
    const view = viewOf(parts.close, pose.x, pose.y, now.across);
    near.clearRect(0, 0, parts.close.width, parts.close.height);
    drawGrid(near, parts.close, view, 0.5, look.grid);
    for (const shape of mission.obstacles) {
      fillShape(near, view, shape, look.obstacle, look.edge, ratio());
    }
    drawAll(parts.close, view, pose, true);
    drawScale(near, parts.close, view, 0.5, look, ratio());
    drawReadings(parts.readings, now, look, ratio());
    drawTimeline(parts.timeline, now, look, ratio());
    updateStatus(pose);
  }

  /** Updates the status line, and the data attributes for tests and scripts. */
  function updateStatus(pose) {
    const mission = now.mission, end = mission.time[mission.time.length - 1];
    const mode = now.run.modes[mission.mode[now.last]] || "none";
    const failures = mission.failed.filter((failure) => failure.at_s <= now.time);
    const visited = mission.reached.filter(([at]) => at <= now.time).length;
    const touching = mission.contact[now.last] === 1;
    parts.scrub.value = now.time;
    parts.scrub.setAttribute("aria-valuetext", `${now.time.toFixed(1)} seconds`);
    parts.clock.textContent = `${now.time.toFixed(1)} / ${end.toFixed(1)} s`;
    const words = [mode, `${visited} of ${mission.goals} waypoints`];
    if (touching) words.push("touches an obstacle");
    const parts_failed = mission.parts_failed.filter((failure) => failure.at_s <= now.time);
    words.push(...[...failures, ...parts_failed].map(describeFault));
    parts.status.textContent = words.join(" · ");
    Object.assign(root.dataset, {
      run: now.run.run, design: now.run.design, world: mission.world, playing: now.playing, mode, visited, touching,
      agents: mission.agents.map((path) => poseAt(path, now.last, now.time))
        .map((agent) => `${agent.x.toFixed(4)} ${agent.y.toFixed(4)}`).join(";"),
      walkers: mission.walkers.map((walker) => poseAt(walker, now.last, now.time))
        .map((walker) => `${walker.x.toFixed(4)} ${walker.y.toFixed(4)}`).join(";"),
      time: now.time.toFixed(3), x: pose.x.toFixed(4), y: pose.y.toFixed(4),
      yaw: pose.yaw.toFixed(4), failed: failures.map((failure) => failure.sensor).join(" "),
      partsFailed: parts_failed.map((failure) => failure.part).join(" "),
      readings: now.run.sensors.map((_, i) => stateOf(now, i).reading)
        .map((reading) => (reading === null ? "" : reading.toFixed(3))).join(" "),
      signals: now.run.signals.map((signal, i) => signalState(now, i).values
        .map((value, k) => writeSignal(signal, k, value)).join(", ")).join("; "),
    });
  }

  function seek(time) {
    const end = now.mission.time[now.mission.time.length - 1];
    now.time = Math.max(0, Math.min(end, time));
    draw();
    if (now.time >= end && now.playing) play(false);
  }

  function animate(stamp) {
    if (!now.playing || !root.isConnected) return;
    const elapsed = before === null ? 0 : Math.min(0.1, (stamp - before) / 1000);
    before = stamp;
    seek(now.time + elapsed * Number(parts.speed.value));
    requestAnimationFrame(animate);
  }

  function play(on) {
    const end = now.mission.time[now.mission.time.length - 1];
    if (on && now.time >= end) now.time = 0;
    const starts = on && !now.playing;
    now.playing = on;
    before = null;
    parts.play.textContent = on ? "❚❚ Pause" : "▶ Play";
    draw();
    if (starts) requestAnimationFrame(animate);
  }

  function chooseWorld() {
    const raw = now.run.missions[Number(parts.world.value)];
    now.mission = decode({ ...grounds[raw.ground], ...raw });
    now.time = 0;
    now.playing = false;
    parts.scrub.max = now.mission.time[now.mission.time.length - 1];
    parts.ended.textContent = now.mission.summary;
    fit();
    play(false);
  }

  function chooseRun() {
    shown = scripts[Number(parts.run.value)];
    now.run = JSON.parse(shown.textContent);
    const world = parts.world.selectedOptions[0]?.textContent;
    parts.world.replaceChildren(...now.run.missions.map((mission, i) =>
      new Option(mission.world, i, false, mission.world === world)));
    parts.key.replaceChildren(...now.run.modes.slice(1).map((mode, i) => {
      const swatch = document.createElement("i");
      swatch.style.background = `var(--mode${(i + 1) % 5})`;
      const entry = document.createElement("span");
      entry.append(swatch, mode);
      return entry;
    }));
    chooseWorld();
  }

  function handleKey(event) {
    if (event.target instanceof HTMLSelectElement || event.ctrlKey || event.metaKey) return;
    const leap = event.shiftKey ? 10 : 1;
    const end = now.mission.time[now.mission.time.length - 1];
    const actions = {
      " ": () => play(!now.playing),
      ArrowLeft: () => seek(now.time - leap),
      ArrowRight: () => seek(now.time + leap),
      Home: () => seek(0),
      End: () => seek(end),
      "+": () => zoom(0.8),
      "-": () => zoom(1.25),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }

  function zoom(factor) {
    now.across = Math.max(1, Math.min(12, now.across * factor));
    draw();
  }

  /** Chooses the run or the design of a key, or hides the player if it has none. */
  function choose(key) {
    const place = scripts.findIndex((script) => script.dataset.key === key);
    root.hidden = place < 0;
    if (root.hidden) return play(false);
    parts.run.value = place;
    chooseRun();
  }

  function readScripts() {
    scripts = [...document.querySelectorAll(`script[data-players~="${root.dataset.player}"]`)];
    grounds = JSON.parse(document.querySelector("script[data-grounds]").textContent);
    parts.run.replaceChildren(...scripts.map((script, i) => new Option(script.dataset.label, i)));
  }

  /** Takes the missions over that are in the page now; the one that is shown stays if it is. */
  function renew() {
    const earlier = shown;
    readScripts();
    const place = scripts.findIndex((script) => script.dataset.key === earlier.dataset.key);
    if (place < 0) return scripts.length ? chooseRun() : choose("");
    parts.run.value = place;
    if (scripts[place].textContent !== earlier.textContent) return chooseRun();
    shown = scripts[place];
  }

  parts.run.addEventListener("change", () => {
    chooseRun();
    const key = scripts[Number(parts.run.value)].dataset.key;
    root.dispatchEvent(new CustomEvent("chosen", { detail: key }));
  });
  root.addEventListener("choose", ({ detail }) => choose(detail));
  parts.world.addEventListener("change", chooseWorld);
  parts.play.addEventListener("click", () => play(!now.playing));
  parts.scrub.addEventListener("input", () => seek(Number(parts.scrub.value)));
  parts.nearer.addEventListener("click", () => zoom(0.8));
  parts.farther.addEventListener("click", () => zoom(1.25));
  root.addEventListener("keydown", handleKey);
  // A focused button would react again when the space bar is released.
  root.addEventListener("keyup", (event) => event.key === " " && event.preventDefault());
  root.addEventListener("fit", fit);
  root.addEventListener("renew", renew);
  readScripts();
  chooseRun();
  root.dataset.ready = true;
}

function startPlayers(within) {
  within.querySelectorAll("[data-player]").forEach(startPlayer);
}

startPlayers(document);
