// The gallery's page: what is chosen in it is in its address, so that a link shows what the sender saw.

import './btf_view.js';

const view = document.querySelector('btf-view');
const shape = document.querySelector('#shape');
const daylight = document.querySelector('#daylight');
const share = document.querySelector('#share');
const KEYS = ['src', 'mesh', 'leaf', 'landscape', 'scene', 'daylight', 'place', 'repeat'];

// What the address asks for: its fragment, or ?asset=URL.
function asked() {
  const fragment = new URLSearchParams(location.hash.slice(1));
  const query = new URLSearchParams(location.search);
  const asset = fragment.get('asset') ?? query.get('asset');
  const all = { src: asset, view: fragment.get('view') };
  for (const key of KEYS.slice(1)) {
    all[key] = fragment.get(key) ?? query.get(key);
  }
  if (!asset && !all.leaf && !all.landscape && !all.scene) {
    all.src = document.querySelector('#gallery [data-src]').dataset.src;
  }
  return all;
}

// Sets attributes of the element, or removes those without a value.
function set(attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (!value) {
      view.removeAttribute(name);
    } else if (view.getAttribute(name) !== value) {
      view.setAttribute(name, value);
    }
  }
}

// Makes the element show it.
function follow() {
  const { view: seen, ...attributes } = asked();
  if (seen) {
    view.view = seen;
  }
  set(attributes);
  mark();
}

function mark() {
  const mesh = view.getAttribute('mesh') ?? '';
  // A sphere has a name, too, and what a visitor has opened is none of these.
  shape.value = mesh === 'sphere' ? '' : mesh;
  daylight.checked = view.hasAttribute('daylight');
  for (const entry of document.querySelectorAll('#gallery button')) {
    const { src, leaf, landscape } = entry.dataset;
    const is = (name, value) => value !== undefined && view.getAttribute(name) === value;
    entry.setAttribute('aria-pressed', is('src', src) || is('leaf', leaf) || is('landscape', landscape));
  }
}

// Writes into the address what the element shows.
function remember(link) {
  const fragment = new URLSearchParams();
  for (const key of KEYS) {
    if (view.hasAttribute(key)) {
      fragment.set(key === 'src' ? 'asset' : key, view.getAttribute(key));
    }
  }
  if (link && link !== '{}') {
    fragment.set('view', link);
  }
  history.replaceState(null, '', `#${fragment}`);
}

// Shows what the user has chosen, after a question where edits would be lost.
function choose(attributes) {
  if (!view.unsaved || window.confirm('Edits are not saved. Go on without them?')) {
    set(attributes);
    remember();
  }
  mark();
}

for (const entry of document.querySelectorAll('#gallery button')) {
  const { src, leaf, landscape } = entry.dataset;
  // Leaves and landscapes have shapes of their own.
  entry.onclick = () => choose({ src, leaf, landscape, mesh: src && shape.value });
}
shape.onchange = () => choose({ mesh: shape.value });
daylight.onchange = () => choose({ daylight: daylight.checked && 'sun' });
document.querySelector('#open').onclick = () => view.choose();
share.onclick = async () => {
  remember(view.view);
  await navigator.clipboard?.writeText(location.href).catch(() => {});
  share.textContent = 'link copied';
  setTimeout(() => { share.textContent = 'share'; }, 1500);
};
view.addEventListener('link', ({ detail }) => remember(detail));
window.addEventListener('hashchange', follow);
follow();
