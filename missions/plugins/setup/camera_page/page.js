"use strict";
/* Shows the newest picture and its caption, and a note when the pictures end. */
(() => {
  const TIMEOUT = 3000; // ms; there is at least one picture a second

  const picture = document.querySelector("#picture");
  const words = document.querySelector("#words");
  let silence = 0;

  function wait() {
    clearTimeout(silence);
    silence = setTimeout(() => (words.textContent = "no more pictures: `mission see` has ended"), TIMEOUT);
  }

  new EventSource("events").onmessage = ({ data }) => {
    const { jpeg, told } = JSON.parse(data);
    if (jpeg) picture.src = `data:image/jpeg;base64,${jpeg}`;
    words.textContent = told;
    wait();
  };
  wait();
})();
