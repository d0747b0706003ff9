// <btf-view src="cloth.spmm" mesh="sphere">a still picture</btf-view>: a material, a leaf or a landscape that its visitors turn, light
// and edit. It draws in a worker and loads in another; where WebGPU is missing it shows what stands between its tags.

// The volumes of landscapes, of the folder volumes.
const VOLUMES = { lawn: ['lawn', 'lawn_flower'], grove: ['tree'], forest: ['forest', 'forest_spruce'] };
// A table that the description of a leaf has and that of a scene has not.
const LEAF_TABLE = /^\s*\[(contents|gloss|look|variation)\]/m;
const NO_WEBGPU = 'This needs WebGPU, which this browser does not have or has turned off; the picture is a still one.';

let compiled;

// Compiles the program once for all elements and workers.
function compile() {
  compiled ??= WebAssembly.compileStreaming(fetch(new URL('./btf_viewer_bg.wasm', import.meta.url)))
    // Servers that do not know the type of .wasm files are common.
    .catch(async () => {
      const response = await fetch(new URL('./btf_viewer_bg.wasm', import.meta.url));
      if (!response.ok) {
        throw new Error(`the program cannot be loaded: the server answers ${response.status}`);
      }
      return WebAssembly.compile(await response.arrayBuffer());
    });
  compiled.catch(() => { compiled = undefined; });
  return compiled;
}

function worker(name) {
  return new Worker(new URL(`./${name}.js`, import.meta.url), { type: 'module' });
}

function modifiersOf(event) {
  return Number(event.shiftKey) | Number(event.ctrlKey) << 1 | Number(event.altKey) << 2 | Number(event.metaKey) << 3;
}

/** Name of the file that a URL names. */
export function nameOf(url) {
  return decodeURIComponent(new URL(url, document.baseURI).pathname.split('/').pop()) || 'asset.spmm';
}

const STYLE = `
  :host { display: block; position: relative; min-height: 240px; background: #1b1b1b; }
  canvas { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none; outline: none; }
  input { position: absolute; left: 0; bottom: 0; width: 1px; height: 1px; opacity: 0; border: 0; padding: 0; }
  p { position: absolute; left: 8px; bottom: 8px; margin: 0; padding: 4px 8px; max-width: calc(100% - 16px); box-sizing: border-box;
      font: 13px/1.35 system-ui, sans-serif; color: #eee; background: #000a; border-radius: 4px; }
  p:empty { display: none; }
  p.error { background: #8b1a1ae0; }
  button { margin-left: 8px; font: inherit; }
  slot { display: none; }
  :host([without-webgpu]) slot { display: block; position: absolute; inset: 0; }
  :host([without-webgpu]) canvas { display: none; }
  ::slotted(img) { width: 100%; height: 100%; object-fit: contain; display: block; }
`;

/**
 * The element. Events: `picture` (detail: samples a pixel), `link` (detail: how the scene is seen, for its property `view`),
 * `message` (detail: text), `loaded` (detail: { bytes, isWhole }).
 */
export class BtfView extends HTMLElement {
  static observedAttributes = ['src', 'mesh', 'leaf', 'landscape', 'scene', 'daylight', 'place', 'repeat'];

  /** Whether edits are unsaved. */
  unsaved = false;

  #canvas;
  #context;
  #input;
  #message;
  #viewer;
  #loader;
  #load = 0;
  #pending = false;
  #files = new Map();
  #fingers = new Map();
  #link = '';

  constructor() {
    super();
    const root = this.attachShadow({ mode: 'open' });
    root.innerHTML = `<style>${STYLE}</style><slot></slot><canvas tabindex="0"></canvas>
      <input autocapitalize="off" autocomplete="off" spellcheck="false" tabindex="-1" aria-hidden="true"><p role="status"></p>`;
    this.#canvas = root.querySelector('canvas');
    this.#input = root.querySelector('input');
    this.#message = root.querySelector('p');
    this.#canvas.setAttribute('aria-label', 'picture of the material: drag to turn, wheel to come nearer, H for the keys');
  }

  connectedCallback() {
    this.#start();
  }

  disconnectedCallback() {
    this.#stop();
  }

  // Several attributes that change together are one change.
  attributeChangedCallback() {
    if (!this.#isOpen || this.#pending) {
      return;
    }
    this.#pending = true;
    queueMicrotask(() => {
      this.#pending = false;
      this.#show();
    });
  }

  /** How the scene is seen: camera, light and settings, as text. */
  get view() {
    return this.#link;
  }

  set view(text) {
    this.#link = text;
    // What is opened later is seen so.
    if (this.#isOpen) {
      this.#send({ kind: 'show', shown: this.#shown(), link: text });
    }
  }

  /** Opens files as if they were dropped, at a place of the window where one is given. */
  async open(files, at) {
    const all = [...files];
    // What a file names is there before it.
    const isNamed = (file) => !/\.(spmm|glb|gltf|obj|hdr|exr|toml|voltex)$/i.test(file.name);
    // A leaf is there before the model that is made of it, a scene after all that it names.
    const leaves = new Set();
    for (const file of all) {
      if (/\.toml$/i.test(file.name) && LEAF_TABLE.test(await file.text())) {
        leaves.add(file);
      }
    }
    const isScene = (file) => /\.toml$/i.test(file.name) && !leaves.has(file);
    const order = (file) => {
      if (isNamed(file) || leaves.has(file) && all.some(isScene)) {
        return 0;
      }
      return leaves.has(file) ? 1 : isScene(file) || /\.gltf$/i.test(file.name) ? 3 : 2;
    };
    all.sort((a, b) => order(a) - order(b));
    // Where nothing can be opened the viewer says so.
    const isLost = all.length > 0 && all.every(isNamed);
    for (const file of all) {
      const bytes = await file.arrayBuffer();
      if (/\.spmm$/i.test(file.name) && !all.some((other) => order(other) === 3)) {
        this.#expand(file.name, bytes, at);
        continue;
      }
      this.#hand(file.name, bytes);
      if (isLost || order(file) > 0 && !(order(file) === 2 && all.some((other) => order(other) === 3))) {
        this.#send({ kind: 'drop', name: file.name, ...at });
      }
    }
  }

  /** Draws a picture that is not shown, of so many samples a pixel: a PNG as a Blob. */
  picture({ width = 512, height = 512, samples = 16 } = {}) {
    if (this.hasAttribute('without-webgpu')) {
      return Promise.reject(new Error(NO_WEBGPU));
    }
    return new Promise((resolve, reject) => {
      const id = this.#drawn.length;
      this.#drawn.push({ resolve, reject });
      this.#send({ kind: 'draw', id, shown: this.#shown(), link: this.#link, width, height, samples });
    });
  }

  #drawn = [];

  // What is asked for before the viewer is there.
  #waiting = [];
  #isOpen = false;

  #whenOpen(act) {
    if (this.#isOpen) {
      act();
    } else {
      this.#waiting.push(act);
    }
  }

  #send(message, parts = []) {
    this.#whenOpen(() => this.#viewer.postMessage(message, parts));
  }

  async #start() {
    if (!navigator.gpu || !(await navigator.gpu.requestAdapter())) {
      this.toggleAttribute('without-webgpu', true);
      this.#tell(NO_WEBGPU);
      return;
    }
    if (!this.isConnected || this.#viewer) {
      return;
    }
    this.toggleAttribute('without-webgpu', false);
    this.#tell('loading the program');
    this.#context = this.#canvas.getContext('bitmaprenderer', { alpha: false });
    this.#viewer = worker('viewer_worker');
    this.#viewer.onmessage = ({ data }) => this.#take(data);
    this.#loader = worker('loader_worker');
    this.#loader.onmessage = ({ data }) => this.#takeLoaded(data);
    for (const each of [this.#viewer, this.#loader]) {
      each.onerror = (event) => this.#fail(event.message ?? 'a worker cannot be started');
    }
    let module;
    try {
      module = await compile();
    } catch (error) {
      this.#fail(error.message);
      return;
    }
    this.#loader.postMessage({ kind: 'open', module });
    const { width, height, pixelsPerPoint } = this.#size();
    this.#viewer.postMessage({
      kind: 'open', module, width, height, pixelsPerPoint, shown: this.#shownFirst(), link: this.#link,
    });
    this.#isOpen = true;
    this.#listen();
    if (['leaf', 'landscape', 'scene'].some((name) => this.hasAttribute(name))) {
      this.#show(this.#link);
    } else {
      this.#loadSource();
    }
    // A file that was dropped meanwhile is shown in place of the attributes' one.
    this.#waiting.splice(0).forEach((act) => act());
  }

  #stop() {
    this.#viewer?.terminate();
    this.#loader?.terminate();
    this.#viewer = this.#loader = undefined;
    this.#isOpen = this.unsaved = false;
    this.#files.clear();
    this.#listening?.abort();
  }

  // Begins anew after a defect or the loss of the graphics device, with what was seen last.
  #restart() {
    this.#stop();
    this.#start();
  }

  #attributes() {
    const shown = {};
    for (const name of ['mesh', 'leaf', 'landscape', 'scene', 'daylight', 'place']) {
      if (this.hasAttribute(name) && this.getAttribute(name) !== '') {
        shown[name] = this.getAttribute(name);
      }
    }
    if (Number(this.getAttribute('repeat')) > 0) {
      shown.repeat = Number(this.getAttribute('repeat'));
    }
    return shown;
  }

  // Without what files are needed for, which are on their way.
  #shownFirst() {
    const { mesh, repeat } = this.#attributes();
    return { mesh, repeat };
  }

  #shown() {
    const shown = this.#attributes();
    const name = this.getAttribute('src') && nameOf(this.getAttribute('src'));
    if (name && this.#files.has(name)) {
      shown.asset = `expanded/${name}`;
    }
    return shown;
  }

  // Shows what the attributes tell, seen as `link` tells, or as it usually is.
  async #show(link) {
    const shown = this.#shown();
    await this.#loadVolumes(shown.landscape);
    this.#send({ kind: 'show', shown, link });
    this.#loadSource();
  }

  // Hands the volumes of a landscape over, which are not part of the program.
  async #loadVolumes(landscape) {
    for (const name of VOLUMES[landscape] ?? []) {
      const file = `volumes/${name}.voltex`;
      if (this.#files.has(file)) {
        continue;
      }
      this.#tell(`loading the ${landscape}`);
      const response = await fetch(new URL(`./${file}`, import.meta.url));
      if (!response.ok) {
        this.#tell(`${file}: the server answers ${response.status}`, true);
        return;
      }
      const bytes = await response.arrayBuffer();
      this.#files.set(file, bytes.byteLength);
      this.#hand(file, bytes);
      this.#tell('');
    }
  }

  #loadSource() {
    const source = this.getAttribute('src');
    if (source && !this.#files.has(nameOf(source))) {
      this.#load += 1;
      this.#tell(`loading ${nameOf(source)}`);
      const url = new URL(source, document.baseURI).href;
      this.#loader.postMessage({ kind: 'load', id: this.#load, url, name: nameOf(source) });
    }
  }

  // Has an asset that is at hand made ready for the viewer.
  #expand(name, bytes, at) {
    this.#whenOpen(() => {
      this.#load += 1;
      this.#dropped = { id: this.#load, at };
      this.#tell(`reading ${name}`);
      this.#loader.postMessage({ kind: 'expand', id: this.#load, name, bytes }, [bytes]);
    });
  }

  #dropped;

  #hand(name, bytes) {
    this.#send({ kind: 'file', name, bytes }, [bytes]);
  }

  #takeLoaded(data) {
    if (data.id !== this.#load) {
      // Something else was asked for meanwhile.
      return;
    }
    if (data.kind === 'failed') {
      this.#tell(`${data.name}: ${data.message}`, true);
      return;
    }
    const { name, expanded, original, isWhole, bytes } = data;
    this.#hand(`expanded/${name}`, expanded.buffer);
    if (original) {
      this.#hand(name, original.buffer);
    }
    const isFirst = !this.#files.has(name);
    this.#files.set(name, bytes);
    const dropped = this.#dropped?.id === data.id ? this.#dropped : undefined;
    if (isFirst && !dropped) {
      this.#send({ kind: 'show', shown: this.#shown(), link: this.#link });
    } else {
      this.#send({ kind: 'drop', name: `expanded/${name}`, ...dropped?.at });
    }
    this.#tell(isWhole ? '' : `${name}: ${Math.round(bytes / 1024)} kB shown, more to come`);
    this.dispatchEvent(new CustomEvent('loaded', { detail: { name, bytes, isWhole } }));
  }

  #take(data) {
    switch (data.kind) {
      case 'opened':
        if (this.#message.textContent === 'loading the program') {
          this.#tell('');
        }
        break;
      case 'picture':
        this.#takePicture(data);
        break;
      case 'drawn': {
        const { resolve, reject } = this.#drawn[data.id];
        if (data.png) {
          resolve(new Blob([data.png], { type: 'image/png' }));
        } else {
          reject(new Error(data.message));
        }
        break;
      }
      case 'written':
        this.#save(data.name, data.bytes);
        break;
      case 'link':
        this.#link = data.link;
        this.dispatchEvent(new CustomEvent('link', { detail: data.link }));
        break;
      case 'message':
        this.dispatchEvent(new CustomEvent('message', { detail: data.message }));
        break;
      case 'refused':
        this.#tell(data.message, true);
        break;
      case 'failed':
        this.#fail(data.message);
        break;
    }
  }

  #takePicture({ picture, cursor, copied, chooseFile, isTyping, hasUnsaved, samples }) {
    this.unsaved = hasUnsaved;
    // A canvas shows a picture at its own size.
    if (this.#canvas.width !== picture.width || this.#canvas.height !== picture.height) {
      this.#canvas.width = picture.width;
      this.#canvas.height = picture.height;
    }
    this.#context.transferFromImageBitmap(picture);
    this.#canvas.style.cursor = cursor;
    if (copied) {
      navigator.clipboard?.writeText(copied).catch(() => {});
    }
    if (chooseFile) {
      this.choose();
    }
    // The keyboard of a phone comes with a field that has the focus.
    if (isTyping && this.#fingers.size === 0 && this.#touched && this.shadowRoot.activeElement !== this.#input) {
      this.#input.focus();
    } else if (!isTyping && this.shadowRoot.activeElement === this.#input) {
      this.#canvas.focus();
    }
    this.dispatchEvent(new CustomEvent('picture', { detail: samples }));
  }

  #touched = false;

  /** Has the user choose files to open. */
  choose() {
    const chooser = document.createElement('input');
    chooser.type = 'file';
    chooser.multiple = true;
    chooser.onchange = () => this.open(chooser.files);
    chooser.click();
  }

  #save(name, bytes) {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([bytes]));
    link.download = name.split('/').pop();
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }

  #tell(text, isError = false) {
    this.#message.textContent = text;
    this.#message.className = isError ? 'error' : '';
  }

  #fail(message) {
    this.#tell(message, true);
    const again = document.createElement('button');
    again.textContent = 'begin again';
    again.onclick = () => this.#restart();
    this.#message.append(again);
  }

  #size() {
    const pixelsPerPoint = Math.min(window.devicePixelRatio || 1, 2);
    const side = (points) => Math.max(1, Math.round(points * pixelsPerPoint));
    return { width: side(this.clientWidth), height: side(this.clientHeight), pixelsPerPoint };
  }

  #listening;

  #listen() {
    this.#listening = new AbortController();
    const options = { signal: this.#listening.signal };
    const send = (message) => this.#send(message);
    const resized = new ResizeObserver(() => send({ kind: 'resize', ...this.#size() }));
    // What nobody sees is not drawn.
    const seen = new IntersectionObserver(([{ isIntersecting }]) => send({ kind: 'rest', rests: !isIntersecting }));
    for (const observer of [resized, seen]) {
      observer.observe(this);
      options.signal.addEventListener('abort', () => observer.disconnect());
    }
    const place = (event) => {
      const { left, top } = this.#canvas.getBoundingClientRect();
      return { x: event.clientX - left, y: event.clientY - top };
    };
    const on = (name, take, target = this.#canvas) => target.addEventListener(name, take, { ...options, passive: false });
    const button = (event, pressed) => {
      send({ kind: 'button', ...place(event), button: event.button, pressed, modifiers: modifiersOf(event) });
    };
    on('pointerdown', (event) => {
      this.#canvas.focus({ preventScroll: true });
      this.#canvas.setPointerCapture(event.pointerId);
      this.#touched = event.pointerType === 'touch';
      if (this.#touched) {
        this.#finger(event, 0, place(event), send);
      } else {
        button(event, true);
      }
      event.preventDefault();
    });
    on('pointermove', (event) => {
      if (event.pointerType === 'touch') {
        this.#finger(event, 1, place(event), send);
      } else {
        send({ kind: 'move', ...place(event), modifiers: modifiersOf(event) });
      }
    });
    const up = (event) => {
      if (event.pointerType === 'touch') {
        this.#finger(event, 2, place(event), send);
      } else {
        button(event, false);
      }
    };
    on('pointerup', up);
    on('pointercancel', up);
    on('pointerleave', (event) => event.pointerType !== 'touch' && send({ kind: 'leave' }));
    on('contextmenu', (event) => event.preventDefault());
    on('wheel', (event) => {
      send({ kind: 'wheel', x: event.deltaX, y: event.deltaY, lines: event.deltaMode === 1, modifiers: modifiersOf(event) });
      event.preventDefault();
    });
    for (const target of [this.#canvas, this.#input]) {
      on('keydown', (event) => this.#key(event, true, send), target);
      on('keyup', (event) => this.#key(event, false, send), target);
      on('paste', (event) => send({ kind: 'text', text: event.clipboardData.getData('text') }), target);
    }
    on('input', () => {
      send({ kind: 'text', text: this.#input.value });
      this.#input.value = '';
    }, this.#input);
    on('beforeunload', (event) => this.unsaved && event.preventDefault(), window);
    on('dragover', (event) => event.preventDefault(), this);
    on('drop', (event) => {
      event.preventDefault();
      this.open(event.dataTransfer.files, place(event));
    }, this);
  }

  // The first finger is the pointer as well.
  #finger(event, phase, at, send) {
    if (phase === 1 && !this.#fingers.has(event.pointerId)) {
      return;
    }
    this.#fingers.set(event.pointerId, phase);
    const isFirst = this.#fingers.keys().next().value === event.pointerId;
    send({ kind: 'touch', id: event.pointerId, phase, ...at });
    if (isFirst) {
      send({ kind: 'move', ...at, modifiers: modifiersOf(event) });
      if (phase !== 1) {
        send({ kind: 'button', ...at, button: 0, pressed: phase === 0, modifiers: modifiersOf(event) });
      }
    }
    if (phase === 2) {
      this.#fingers.delete(event.pointerId);
      if (this.#fingers.size === 0) {
        send({ kind: 'leave' });
      }
    }
  }

  #key(event, pressed, send) {
    send({ kind: 'key', name: event.key, pressed, repeat: event.repeat, modifiers: modifiersOf(event) });
    const isCommand = event.ctrlKey || event.metaKey || event.altKey;
    if (pressed && event.key.length === 1 && !isCommand) {
      send({ kind: 'text', text: event.key });
      event.preventDefault();
    }
    // The browser keeps its own keys, but for those of the window.
    const own = isCommand ? /^[zyso]$/i : /^(Arrow|Backspace|Tab|Page|Home|End|F1$)/;
    if (own.test(event.key)) {
      event.preventDefault();
    }
  }
}

customElements.define('btf-view', BtfView);
