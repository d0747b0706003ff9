// The worker that draws: the viewer in WebAssembly on a canvas of its own, whose pictures go to the page.

import { deferPipelines } from './deferred_pipelines.js';
import init, { Viewer, drawPicture, handOver, takeWritten } from './btf_viewer.js';

// Between two looks at how the scene is seen, for the page's address.
const LINK_MS = 400;

let viewer;
let canvas;
let timer;
let animation;
let lastLink;
let linkedAt = 0;
let lastMessage;
let ended = false;
let rests = false;

function fail(error) {
  ended = true;
  postMessage({ kind: 'failed', message: error?.message ?? String(error) });
}

deferPipelines((message) => fail(new Error(`a shader cannot be compiled: ${message}`)));

// Draws a frame, and plans the next one.
function draw() {
  clearTimeout(timer);
  timer = animation = undefined;
  if (ended) {
    return;
  }
  try {
    const frame = viewer.frame(performance.now() / 1000);
    if (frame.isDrawn) {
      const picture = canvas.transferToImageBitmap();
      postMessage({ ...frame, kind: 'picture', picture, samples: viewer.samples() }, [picture]);
    }
    tellTheRest();
    plan(frame.nextInMs);
  } catch (error) {
    fail(error);
  }
}

// Has the next frame drawn in so many milliseconds, or earlier where that is planned.
function plan(ms) {
  if (rests) {
    return;
  }
  if (ms === 0) {
    animation ??= requestAnimationFrame(draw);
  } else if (Number.isFinite(ms) && animation === undefined) {
    clearTimeout(timer);
    // Longer times overflow.
    timer = setTimeout(draw, Math.min(ms, 1e6));
  }
}

// Tells the page what was written, what happened, and how the scene is seen.
function tellTheRest() {
  for (const [name, bytes] of takeWritten()) {
    postMessage({ kind: 'written', name, bytes }, [bytes.buffer]);
  }
  const message = viewer.message();
  if (message !== lastMessage) {
    lastMessage = message;
    postMessage({ kind: 'message', message });
  }
  const now = performance.now();
  if (now > linkedAt + LINK_MS) {
    linkedAt = now;
    const link = viewer.link();
    if (link !== lastLink) {
      lastLink = link;
      postMessage({ kind: 'link', link });
    }
  }
}

const tasks = {
  async open({ module, width, height, pixelsPerPoint, shown, link }) {
    await init({ module_or_path: module });
    canvas = new OffscreenCanvas(width, height);
    viewer = await Viewer.open(canvas, width, height, pixelsPerPoint, JSON.stringify(shown));
    if (link) {
      viewer.follow(link);
    }
    postMessage({ kind: 'opened' });
  },
  file({ name, bytes }) {
    handOver(name, new Uint8Array(bytes));
  },
  // Shows something else; what the page asks for next is drawn on it.
  show({ shown, link }) {
    try {
      viewer.show(JSON.stringify(shown));
      if (link) {
        viewer.follow(link);
      }
      postMessage({ kind: 'shown' });
    } catch (error) {
      // What was shown is still there.
      postMessage({ kind: 'refused', message: error.message });
    }
  },
  // Nobody sees the canvas, or somebody does again.
  rest(data) {
    ({ rests } = data);
  },
  // Others go on meanwhile.
  draw({ id, shown, link, width, height, samples }) {
    drawPicture(JSON.stringify(shown), link, width, height, samples).then(
      (png) => postMessage({ kind: 'drawn', id, png }, [png.buffer]),
      (error) => postMessage({ kind: 'drawn', id, message: error.message }),
    );
  },
  drop({ name, x, y }) {
    viewer.openFile(name, x ?? NaN, y ?? NaN);
  },
  resize({ width, height, pixelsPerPoint }) {
    viewer.resize(width, height, pixelsPerPoint);
  },
  move({ x, y, modifiers }) {
    viewer.modifiers(modifiers);
    viewer.pointerMoved(x, y);
  },
  button({ x, y, button, pressed, modifiers }) {
    viewer.modifiers(modifiers);
    viewer.pointerButton(x, y, button, pressed);
  },
  leave() {
    viewer.pointerGone();
  },
  wheel({ x, y, lines, modifiers }) {
    viewer.modifiers(modifiers);
    viewer.wheel(x, y, lines);
  },
  touch({ id, phase, x, y }) {
    viewer.touch(id, phase, x, y);
  },
  key({ name, pressed, repeat, modifiers }) {
    viewer.modifiers(modifiers);
    viewer.key(name, pressed, repeat);
  },
  text({ text }) {
    viewer.text(text);
  },
  // For tests: what is left when a graphics device is lost.
  lose() {
    fail(new Error('the graphics device was lost'));
  },
};

// Events wait until the viewer is open, and keep their order.
let before = Promise.resolve();
onmessage = ({ data }) => {
  before = before.then(async () => {
    if (ended) {
      return;
    }
    try {
      await tasks[data.kind](data);
      if (viewer) {
        plan(0);
      }
    } catch (error) {
      fail(error);
    }
  });
};
