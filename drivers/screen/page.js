"use strict";
/*
 * Shows what the robot sends: each shape is an opacity, the width of its line, and its points. They are not set but
 * approached, so the face moves from one look to the next. When nothing has come for STALE it falls asleep.
 * A click or any key shows it on the full screen.
 */
(() => {
  const STALE = 3000; // ms; the robot sends at least once a second
  const EASE = 55; // ms in which most of a way is gone
  const AGAIN = 2000; // ms until it asks again where it was refused

  const face = document.querySelector("#face");
  const paths = [...face.querySelectorAll("path")];
  const words = document.querySelector("#words");
  const asleep = JSON.parse(document.querySelector("#asleep").textContent);

  let goal = null;
  let now = null;
  let before = 0;
  let moving = false;
  let silence = 0;

  function draw() {
    now.forEach(([opacity, width, x, y, ...others], place) => {
      const path = paths[place];
      path.setAttribute("opacity", opacity.toFixed(2));
      path.setAttribute("stroke-width", width.toFixed(2));
      const rest = others.map((number) => number.toFixed(2)).join(" ");
      path.setAttribute("d", `M${x.toFixed(2)} ${y.toFixed(2)}C${rest}`);
    });
  }

  function step(time) {
    const past = Math.min(Math.max(time - before, 0), 50); // a frame may have begun before its news came
    const share = 1 - Math.exp(-past / EASE);
    before = time;
    moving = false;
    now = now.map((shape, place) =>
      shape.map((number, index) => {
        const left = goal[place][index] - number;
        if (Math.abs(left) < 0.01) return goal[place][index];
        moving = true;
        return number + share * left;
      }),
    );
    draw();
    if (moving) requestAnimationFrame(step);
  }

  function write(lines, size, feet) {
    const texts = lines.map((line, place) => {
      const text = document.createElementNS(face.namespaceURI, "text");
      text.setAttribute("x", 160);
      text.setAttribute("y", feet[place]);
      text.setAttribute("font-size", size);
      text.textContent = line;
      return text;
    });
    words.replaceChildren(...texts);
  }

  function show({ label, shapes, lines, size, feet }) {
    goal = shapes;
    now ??= shapes;
    if (face.getAttribute("aria-label") !== label) {
      face.setAttribute("aria-label", label);
      write(lines, size, feet);
    }
    if (!moving) {
      moving = true;
      before = performance.now();
      requestAnimationFrame(step);
    }
  }

  function listen() {
    const source = new EventSource("events");
    source.onmessage = ({ data }) => {
      const news = JSON.parse(data);
      if (news.edition !== document.documentElement.dataset.edition) {
        location.reload();
        return;
      }
      clearTimeout(silence);
      silence = setTimeout(show, STALE, asleep);
      show(news);
    };
    source.onerror = () => {
      if (source.readyState === EventSource.CLOSED) setTimeout(listen, AGAIN);
    };
  }

  const fill = () => document.documentElement.requestFullscreen?.().catch(() => {});
  addEventListener("click", fill);
  addEventListener("keydown", (event) => event.key === "Escape" || fill());
  silence = setTimeout(show, STALE, asleep);
  listen();
})();
