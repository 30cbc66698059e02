"use strict";
(() => {
  const TRAIL = "#5848c6", CONTACT = "#d55e00", MOVER = "#b03a78";
  const GHOST = 1, FADES = 8, FINENESS = 4, TURNS = 100;
  const scenes = read("scenes");
  const players = new Map();

  for (const section of document.querySelectorAll("section.run")) {
    const player = section.querySelector(".player");
    if (player) players.set(section.id, watch(player));
    openAll(section);
  }
  for (const button of document.querySelectorAll("button.watch")) {
    button.addEventListener("click", () => {
      const place = `run-${button.dataset.run}`;
      players.get(place).show(Number(button.dataset.episode), true);
      goTo(document.getElementById(`watch-${button.dataset.run}`));
    });
  }
  addEventListener("hashchange", reveal);
  for (const cell of document.querySelectorAll("a.cell")) {
    // If the address is already that of the cell, there is no "hashchange".
    cell.addEventListener("click", () => unfold(cell.hash));
  }
  reveal();
  if (location.hash === "#play" && players.size) [...players.values()][0].play();
  if (parent !== window) fitFrame();

  function read(id) {
    return JSON.parse(document.getElementById(id).textContent);
  }

  // A page around this one makes its frame as high as this page, and scrolls to where
  // this page goes: the frame has no rights, and cannot be measured from outside.
  function fitFrame() {
    document.documentElement.classList.add("framed");
    const height = () => Math.ceil(document.body.getBoundingClientRect().height);
    new ResizeObserver(() => tell({ height: height() })).observe(document.body);
  }

  function goTo(element) {
    if (parent === window) element.scrollIntoView();
    else setTimeout(() => tell({ at: element.getBoundingClientRect().top }), 50);
  }

  function tell(about) {
    parent.postMessage({ tdac: about }, "*");
  }

  function reveal() {
    if (unfold(location.hash)) goTo(document.querySelector(location.hash));
  }

  function unfold(hash) {
    const target = /^#[\w-]+$/.test(hash) ? document.querySelector(hash) : null;
    for (let part = target; part; part = part.parentElement) {
      if (part.tagName === "DETAILS") part.open = true;
    }
    return target;
  }

  function openAll(section) {
    const button = section.querySelector("button.all");
    if (!button) return;
    const parts = section.querySelectorAll("details.iteration");
    button.hidden = parts.length < 2;
    button.addEventListener("click", () => {
      const open = button.textContent === "open all";
      for (const part of parts) part.open = open;
      button.textContent = open ? "close all" : "open all";
    });
  }

  // One row [step, x, y, heading] for each kept step; [step, x, y] of a mover.
  function rows(points, width) {
    const at = [0, 0, 0, 0], found = [];
    for (let n = 0; n < points.length; n += width) {
      for (let i = 0; i < width; i++) at[i] += points[n + i];
      found.push([at[0], at[1] / FINENESS, at[2] / FINENESS, at[3] / TURNS]);
    }
    return found;
  }

  // The interpolated row at a step, and the number of kept rows up to it.
  function poseAt(path, step) {
    let low = 0, high = path.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (path[middle][0] <= step) low = middle; else high = middle;
    }
    const a = path[low], b = path[high];
    const share = b[0] > a[0] ? Math.min(1, (step - a[0]) / (b[0] - a[0])) : 1;
    return [a.map((value, i) => value + share * (b[i] - value)), low + 1];
  }

  function watch(player) {
    const episodes = read(player.dataset.episodes);
    const part = (name) => player.querySelector(`.${name}`);
    const canvas = player.querySelector("canvas"), pen = canvas.getContext("2d");
    const play = part("play"), scrub = part("scrub"), clock = part("clock");
    const ofCandidate = part("candidate"), ofEpisode = part("episode"), speed = part("speed");
    const sharp = Math.min(2, window.devicePixelRatio || 1);
    const background = new Image();
    let scene, episode, path, movers, step = 0, before = null;

    // An episode may have a scene of its own.
    function place(key) {
      if (scene === scenes[key]) return;
      scene = scenes[key];
      canvas.width = scene.width * sharp;
      canvas.height = scene.height * sharp;
      canvas.style.aspectRatio = `${scene.width} / ${scene.height}`;
      canvas.style.width = `${Math.min(720, scene.width)}px`;
      pen.scale(sharp, sharp);
      background.src = scene.picture;
    }

    function line(points, colour, width) {
      pen.beginPath();
      points.forEach(([, x, y], n) => (n ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.lineJoin = pen.lineCap = "round";
      pen.stroke();
    }

    function disc(x, y, radius, fill, stroke, width) {
      pen.beginPath();
      pen.arc(x, y, radius, 0, 2 * Math.PI);
      if (fill) { pen.fillStyle = fill; pen.fill(); }
      if (stroke) { pen.strokeStyle = stroke; pen.lineWidth = width; pen.stroke(); }
    }

    // A mover where it is now, with a fading trail of its last second.
    function mover({ way, radius }) {
      const first = Math.max(0, step - GHOST / episode.dt), trail = [];
      for (let n = 0; n <= FADES; n++) {
        trail.push(poseAt(way, first + (n / FADES) * (step - first))[0]);
      }
      // Layers, each shorter than the one below: pieces side by side would show joints.
      for (let n = 0; n < FADES; n++) line(trail.slice(n), `${MOVER}26`, 2);
      const [, x, y] = trail[FADES];
      disc(x, y, radius, `${MOVER}8c`, MOVER, 1);
    }

    function draw() {
      pen.clearRect(0, 0, scene.width, scene.height);
      if (background.complete) pen.drawImage(background, 0, 0, scene.width, scene.height);
      const [pose, passed] = poseAt(path, step), [, x, y, heading] = pose;
      movers.forEach(mover);
      line(path, `${TRAIL}38`, 2);
      line([...path.slice(0, passed), pose], TRAIL, 3);
      const radius = Math.max(scene.radius, 5);
      disc(x, y, radius, `${TRAIL}59`, TRAIL, 2);
      pen.beginPath();
      for (const turn of [0, 2.6, -2.6]) {
        const angle = heading + turn;
        pen.lineTo(x + 0.7 * radius * Math.cos(angle), y + 0.7 * radius * Math.sin(angle));
      }
      pen.fillStyle = TRAIL;
      pen.fill();
      // A mover is at the contact only at the end.
      if (episode.contact && (!movers.length || step > episode.steps - 1)) {
        const [at, to] = episode.contact, size = Math.max(0.35 * radius, 6);
        disc(at, to, size, null, "#fffc", 6);
        disc(at, to, size, null, CONTACT, 3);
      }
      const seconds = (n) => `${(n * episode.dt).toFixed(1)} s`;
      const now = Math.round(step), end = now >= episode.steps;
      clock.textContent = `step ${now} of ${episode.steps}, ${seconds(now)} of `
        + `${seconds(episode.steps)}${end ? ` – ${episode.outcome}` : ""}`;
      scrub.value = now;
    }

    function pause() {
      before = null;
      play.textContent = "▶";
      play.setAttribute("aria-label", "Play");
    }

    function start() {
      if (step >= episode.steps) step = 0;
      before = performance.now();
      play.textContent = "❚❚";
      play.setAttribute("aria-label", "Pause");
      requestAnimationFrame(tick);
    }

    function tick(now) {
      if (before === null) return;
      const passed = Math.max(0, now - before) / 1000;
      before = Math.max(before, now);
      step = Math.min(episode.steps, step + passed * Number(speed.value) / episode.dt);
      draw();
      if (step >= episode.steps) pause(); else requestAnimationFrame(tick);
    }

    function fill(select, entries) {
      select.replaceChildren(...entries.map(([text, value]) => new Option(text, value)));
    }

    function show(number, playing) {
      pause();
      episode = episodes[number];
      place(episode.scene ?? player.dataset.scene);
      path = rows(episode.points, 4);
      movers = episode.movers.map(({ radius, points }) => (
        { way: rows(points, 3), radius: Math.max(radius, 2) }));
      const same = (e) => e.candidate === episode.candidate;
      fill(ofEpisode, episodes.map((e, n) => [e, n]).filter(([e]) => same(e))
        .map(([e, n]) => [`${e.name}: ${e.outcome}`, n]));
      ofEpisode.value = number;
      ofCandidate.value = episodes.findIndex(same);
      scrub.max = episode.steps;
      step = playing ? 0 : episode.steps;
      draw();
      if (playing) start();
    }

    const first = new Map();
    episodes.forEach((e, n) => first.has(e.candidate) || first.set(e.candidate, n));
    fill(ofCandidate, [...first.values()].map((n) => [episodes[n].label, n]));
    ofCandidate.addEventListener("change", () => {
      // The same episode of the other candidate, if it has it.
      const { candidate } = episodes[Number(ofCandidate.value)], { name } = episode;
      const same = episodes.findIndex((e) => e.candidate === candidate && e.name === name);
      show(same < 0 ? Number(ofCandidate.value) : same, false);
    });
    ofEpisode.addEventListener("change", () => show(Number(ofEpisode.value), false));
    play.addEventListener("click", () => (before === null ? start() : pause()));
    scrub.addEventListener("input", () => { pause(); step = Number(scrub.value); draw(); });
    background.addEventListener("load", draw);
    // The last candidate of a loop is the verified one, if there is one.
    const { begin } = player.dataset;
    show(first.get(begin) ?? [...first.values()].at(begin === "first" ? 0 : -1), false);
    return { show, play: start };
  }
})();
