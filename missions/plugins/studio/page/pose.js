// Pictures of a person from this browser's camera, small enough for a message.

// Instructions for the pictures: recognition needs a face from several sides.
const GUIDE = [
  "Look straight into the camera…", "Turn your head a little to the left…", "Turn your head a little to the right…",
  "Look up a little…", "Look down a little…", "Take a step back, and look into the camera…",
];
const PICTURE_INTERVAL = 1200; // milliseconds to read an instruction and follow it
const MAX_LETTERS = 60000; // letters of base64 in a message

/**
* Show the camera in `place`, show each instruction with `ask`, and call `send` with each picture.
* Throws an Error with the reason and a remedy.
 */
export async function pose(place, ask, send) {
  if (!navigator.mediaDevices)
    throw new Error("A browser allows its camera only over https or from localhost. Try: mission studio --certificate FILE --key FILE");
  const stream = await navigator.mediaDevices.getUserMedia({ video: { width: 640, height: 480 } });
  const video = document.createElement("video");
  try {
    video.muted = video.playsInline = true;
    video.srcObject = stream;
    place.append(video);
    await video.play();
    for (const words of GUIDE) {
      ask(words);
      await new Promise((done) => setTimeout(done, PICTURE_INTERVAL));
      await send(jpeg(video));
    }
  } finally {
    for (const track of stream.getTracks()) track.stop();
    video.remove();
  }
}

/** Return the present video frame as the largest JPEG within MAX_LETTERS. */
function jpeg(video) {
  const canvas = document.createElement("canvas");
  for (let width = 640; ; width *= 0.8) {
    canvas.width = Math.min(width, video.videoWidth);
    canvas.height = (canvas.width * video.videoHeight) / video.videoWidth;
    canvas.getContext("2d").drawImage(video, 0, 0, canvas.width, canvas.height);
    const text = canvas.toDataURL("image/jpeg", 0.85).split(",")[1];
    if (text.length <= MAX_LETTERS) return text;
  }
}
