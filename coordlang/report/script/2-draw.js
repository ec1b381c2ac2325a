// Elements, words as chips and SVG shapes, numbers as text.

const SVG = 'http://www.w3.org/2000/svg';

const byId = name => document.getElementById(name);

function make(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

function draw(tag, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true ? '' : value);
  }
  element.append(...children.filter(child => child !== null && child !== undefined));
  return element;
}

const grouped = value => String(value).replace(/\B(?=(\d{3})+$)/g, ',');
const shortNumber = value => (String(value).length <= 13 ? grouped(value) : `about 10^${String(value).length - 1}`);
function percent(share) {
  if (share > 0 && share < 0.00005) return 'less than 0.01 %';
  return share < 1 && share >= 0.999 ? 'more than 99.9 %' : `${Number((100 * share).toPrecision(3))} %`;
}
const countedPlans = value => `${shortNumber(value)} ${String(value) === '1' ? DATA.kept.plan : DATA.kept.plans}`;
const counted = (value, noun) => `${shortNumber(value)} ${noun}${String(value) === '1' ? '' : 's'}`;
const cut = (text, length) => (text.length <= length ? text : `${text.slice(0, length - 1)}…`);

const wordClass = word => `c${word % 9} p${Math.floor(word / 9) % 4}`;
const robotClass = robot => `r${robot % 6}`;

function wordShort(word) {
  const name = DATA.words[word].name;
  return /^w\d+$/.test(name) ? name.slice(1) : cut(name, 3);
}

function chip(word) { return make('span', { class: `chip ${wordClass(word)}` }, DATA.words[word].name); }

// A shape filled with a word's colour, and with its pattern over it.
function wordShape(tag, geometry, word) {
  const pattern = Math.floor(word / 9) % 4;
  const shapes = [draw(tag, { ...geometry, class: `w ${wordClass(word)}` })];
  if (pattern) shapes.push(draw(tag, { ...geometry, class: 'w-hatch', fill: `url(#hatch${pattern})` }));
  return shapes;
}

// The patterns, once for the whole page.
function hatches() {
  const line = (x1, y1, x2, y2) => draw('line', { x1, y1, x2, y2, stroke: '#000', 'stroke-opacity': .24, 'stroke-width': 1.6 });
  const pattern = (id, ...content) => draw('pattern', { id, width: 7, height: 7, patternUnits: 'userSpaceOnUse' }, ...content);
  return draw('svg', { width: 0, height: 0, style: 'position:absolute', 'aria-hidden': true }, draw('defs', {},
    pattern('hatch1', line(-1, 8, 8, -1), line(-1, 1, 1, -1), line(6, 8, 8, 6)),
    pattern('hatch2', draw('circle', { cx: 3.5, cy: 3.5, r: 1.3, fill: '#000', 'fill-opacity': .34 })),
    pattern('hatch3', line(-1, 8, 8, -1), line(-1, -1, 8, 8))));
}

// Facts of a state, and where each thing is: place numbers, or the thing that has it.
function whereIs(state) {
  const at = new Map(), held = [];
  for (const fact of DATA.states[state]) {
    const [kind, a, b] = DATA.facts[fact].role;
    if (kind === 'at') at.set(a, b);
    if (kind === 'with') held.push([a, b]);
  }
  const carried = new Map();
  for (const [a, b] of held) {
    if (!at.has(b) && at.has(a)) carried.set(b, a); else if (!at.has(a) && at.has(b)) carried.set(a, b);
  }
  return { at, carried };
}

// The place of a thing: its own, or that of whoever has it.
function placeOf(state, thing) {
  const { at, carried } = whereIs(state);
  return at.has(thing) ? at.get(thing) : at.get(carried.get(thing));
}

function told(state) {
  const { at, carried } = whereIs(state);
  if (!DATA.places.length || !at.size) return DATA.states[state].map(f => DATA.facts[f].text).join(' ');
  const parts = [...at].sort((a, b) => a[0] - b[0]).map(([thing, place]) => `${DATA.things[thing]} at ${DATA.places[place].name}`);
  for (const [thing, by] of carried) parts.push(`${DATA.things[thing]} with ${DATA.things[by]}`);
  return parts.join(', ');
}
