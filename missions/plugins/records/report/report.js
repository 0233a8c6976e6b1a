"use strict";
/*
 * Time slider of the report: tree, variables, picture, charts and path show the state at its position.
 *
 * A position is a number from 0 on. A click on an element with data-place goes to that position, on one with data-node
 * to that node of the tree, and on a chart over time (.over-time) to that time.
 */
(() => {
  const { data, showStates, showNode } = missiontree;
  const root = document.documentElement;
  const slider = document.querySelector("#slider");
  const clock = document.querySelector("#clock");
  const note = document.querySelector("#note");
  const begin = data.times[0];
  const span = Math.max(data.times.at(-1) - begin, 1e-3);
  const cells = [...document.querySelectorAll("[data-variable]")];
  const values = [...document.querySelectorAll("[data-line]")];
  const shots = [...document.querySelectorAll(".shot")];
  const seen = document.querySelector("#seen");
  const robots = [...document.querySelectorAll(".robot")];
  const play = document.querySelector("#play");
  const speed = document.querySelector("#speed");
  const lanes = [...document.querySelectorAll("[data-row]")];

  /** Return the number of rows up to a position; a row begins with its position. */
  function countUpTo(rows, place, placeOf = (row) => row[0]) {
    let low = 0;
    let high = rows.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (placeOf(rows[middle]) <= place) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  const newest = (rows, place, placeOf) => rows[countUpTo(rows, place, placeOf) - 1];
  const placeOf = (element) => Number(element.dataset.place);
  const write = (element, text) => {
    if (element.textContent !== text) element.textContent = text;
  };

  // Show a position

  function showTime(place) {
    const time = `${data.times[place].toFixed(2)} s`;
    const tick = `tick ${data.ticks[place]}`;
    slider.setAttribute("aria-valuetext", `${time}, ${tick}`);
    write(clock.firstElementChild, time);
    write(clock.lastElementChild, tick);
    root.style.setProperty("--at", (data.times[place] - begin) / span);
  }

  function showTree(place) {
    const states = {};
    for (const [key, rows] of Object.entries(data.changes)) {
      const row = newest(rows, place);
      if (!row) continue;
      const status = data.statuses[row[1]];
      const age = `${(data.times[place] - data.times[row[0]]).toFixed(1)} s${["running", "suspended"].includes(status) ? "" : " ago"}`;
      states[key] = [status, data.texts[row[2]], age];
    }
    showStates(states);
  }

  function showValues(place) {
    for (const cell of cells) {
      const row = newest(data.variables[cell.dataset.variable], place);
      write(cell, row ? data.texts[row[1]] : "");
      cell.parentElement.classList.toggle("unset", !row);
    }
    for (const value of values) {
      const row = newest(data.lines[value.dataset.line], place);
      write(value, row ? String(row[1]) : "");
    }
  }

  function showPicture(place) {
    if (!seen) return;
    const shot = newest(shots, place, placeOf);
    for (const each of shots) each.classList.toggle("current", each === shot);
    seen.hidden = !shot;
    if (!shot) return;
    const picture = shot.querySelector("img");
    seen.querySelector("img").src = picture.src;
    seen.querySelector("img").alt = picture.alt;
    write(seen.querySelector("figcaption"), shot.title);
    const strip = shot.parentElement;
    strip.scrollLeft = shot.offsetLeft - (strip.clientWidth - shot.offsetWidth) / 2;
  }

  function showRobot(place) {
    const row = newest(data.route, place) ?? data.route[0];
    for (const robot of row ? robots : []) robot.setAttribute("transform", `translate(${row[1]} ${row[2]}) rotate(${row[3]})`);
  }

  let waiting = false;

  /** Show the slider position, at most once per animation frame. */
  function update() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      const place = Number(slider.value);
      for (const show of [showTree, showValues, showPicture, showRobot]) show(place);
    });
  }

  function go(place) {
    slider.value = place;
    showTime(Number(slider.value));
    showNote("");
    update();
  }

  /** Show a note below the slider; with a node key it is a link to that node. */
  function showNote(text, key = "") {
    const [link, plain] = note.children;
    link.dataset.node = key;
    write(link, key ? text : "");
    write(plain, key ? "" : text);
  }

  // Play

  let playing = 0; // ID of the animation frame request; 0 while paused
  const last = data.times.length - 1;

  function pause() {
    playing = 0;
    write(play, "\u25B6 Play");
  }

  /** Play in real time from the slider position; from the beginning if it is at the end. */
  function start() {
    if (Number(slider.value) === last) go(0);
    write(play, "\u23F8 Pause");
    let before = performance.now();
    let time = data.times[Number(slider.value)];
    const step = (now) => {
      if (!playing) return;
      time += (Math.max(0, now - before) / 1000) * Number(speed.value);
      before = now;
      const place = Math.max(0, countUpTo(data.times, time, (each) => each) - 1);
      if (place !== Number(slider.value)) go(place);
      if (place === last) pause();
      else playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  }

  play.addEventListener("click", () => (playing ? pause() : start()));

  // User input

  slider.addEventListener("input", () => {
    pause();
    go(slider.value);
  });

  const jumps = {
    next: (place) => data.failures[countUpTo(data.failures, place)],
    previous: (place) => data.failures[countUpTo(data.failures, place - 1) - 1],
  };

  function jump(which) {
    const failure = jumps[which](Number(slider.value));
    if (!failure) return showNote(which === "next" ? "No later failure." : "No earlier failure.");
    go(failure[0]);
    showNote(failure[2], failure[1]);
  }

  document.addEventListener("click", (event) => {
    const { target } = event;
    const jumping = target.closest("[data-jump]");
    const placed = target.closest("[data-place]");
    const node = target.closest("[data-node]");
    const drawn = target.closest(".over-time");
    if (jumping || placed || drawn) pause();
    if (jumping) jump(jumping.dataset.jump);
    else if (placed) go(placeOf(placed));
    else if (node) showNode(node.dataset.node);
    else if (drawn) {
      const { left, width } = drawn.getBoundingClientRect();
      go(countUpTo(data.times, begin + (span * (event.clientX - left)) / width, (time) => time) - 1);
    }
  });

  document.addEventListener("node", (event) => {
    for (const lane of lanes) lane.classList.toggle("current", lane.dataset.row === event.detail.key);
  });

  const view = document.querySelector(".window");
  const spread = view.querySelector(".spread");
  if (spread && view.scrollWidth > view.clientWidth) document.querySelector("[data-outline]").click();
  document.querySelector(".timebar").hidden = false;
  go(slider.value);
})();
