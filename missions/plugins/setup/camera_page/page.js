"use strict";
/* Shows each picture as it comes, and in words what was found in it; says so when none comes any more. */
(() => {
  const STALE = 3000; // ms; news come at least once a second

  const picture = document.querySelector("#picture");
  const words = document.querySelector("#words");
  let silence = 0;

  function wait() {
    clearTimeout(silence);
    silence = setTimeout(() => (words.textContent = "no more pictures: `mission see` has ended"), STALE);
  }

  new EventSource("events").onmessage = ({ data }) => {
    const { jpeg, told } = JSON.parse(data);
    if (jpeg) picture.src = `data:image/jpeg;base64,${jpeg}`;
    words.textContent = told;
    wait();
  };
  wait();
})();
