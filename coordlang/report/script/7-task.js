// One task: its sentences, its plans played, one robot's choices.

class TaskView {
  constructor(atlas) {
    this.atlas = atlas;
    this.transport = new Transport(byId('transport'), byId('task'), {
      last: () => this.states.length - 1, total: () => this.task.steps, show: step => this.show(step) });
  }

  open(task) {
    this.transport.pause();
    this.task = task;
    this.sentence = -1; this.mode = -1;
    this.random = randomFrom(7);
    this.wordOf = node => DATA.state_words[task.nodes.state[node]];
    this.varying = varyingFacts(task);
    this.scene = DATA.places.length ? new Scene('', this.varying.marks, DATA.places.length <= 60) : null;
    if (this.scene) this.scene.goals(task.goals);
    byId('stage').replaceChildren(...(this.scene ? [this.scene.svg] : []));
    byId('stage').hidden = !this.scene;
    this.space = new SpacePicture(task, node => this.visit(node));
    byId('space').replaceChildren(this.space.svg);
    this.describe(); this.fillModes(); this.fillTint(); this.fillSentences();
    this.choose(task.sentences.length > 1 ? -1 : 0);
  }

  describe() {
    const { task } = this, plans = BigInt(task.plans);
    const cost = task.second === null ? '' : ` (second cost ${task.second})`;
    byId('task-summary').replaceChildren(
      make('strong', {}, countedPlans(plans)), DATA.kept.slack ? ', of at most ' : ' of ', make('strong', {}, counted(task.steps, 'step')), cost, ', ',
      ...(task.all_sentences === null ? ['too many sentences to count. '] : [make('strong', {}, counted(task.all_sentences, 'sentence')), '. ']),
      task.requires === null ? 'Whether coordination is required was not decided: too large.' : task.requires
        ? `Coordination is required: some mixtures of these plans go wrong${task.silence === null ? '' : `, without a word ${percent(task.silence)} of all`}.` : 'No coordination is required: any mixture of these plans is one of them.');
    const warning = byId('task-warning');
    const text = task.violation ? 'In this task it is no coordination language: plans with one sentence miscoordinate, as shown below.'
        + (task.failure === null ? '' : ` Robots that choose by themselves fail in ${percent(task.failure)} of all runs.`)
      : task.covered ? '' : 'This task is not among those that the language was built for. Nothing is guaranteed for it'
        + (task.verified === null ? '.' : '; checked for this page, its sentences hold here.');
    warning.textContent = text; warning.hidden = !text;
    warning.classList.toggle('bad', Boolean(task.violation) || task.verified === null);
    byId('space-note').textContent = (task.complete
      ? `All ${counted(task.nodes.state.length, 'node')} and ${counted(task.target.length, 'joint step')} on ${DATA.kept.plans}; every way from left to right is one. `
      : `Too large to show: of ${counted(task.all_nodes, 'node')} and ${counted(task.all_edges, 'joint step')} on ${DATA.kept.plans}, these are on plans drawn at random. `)
      + 'A node is a joint state, coloured by its word; choose one to see a plan through it.';
    byId('sentences-note').textContent = task.all_sentences === null
      ? `Sentences of plans drawn at random: ${task.sentences.length}.` : task.all_sentences > task.sentences.length
        ? `The ${task.sentences.length} that leave most plans open, of ${grouped(task.all_sentences)}.` : 'Choose one: what it leaves open remains.';
  }

  fillModes() {
    const buttons = [make('button', { type: 'button', 'data-mode': -1, onclick: () => this.play(-1) }, 'Play a plan')];
    DATA.robots.forEach((robot, number) => buttons.push(make('button', { type: 'button', 'data-mode': number, disabled: !this.task.complete,
      title: this.task.complete ? `See what ${robot} may do, and choose for it` : 'Only plans drawn at random are in this page', onclick: () => this.play(number) }, `Be ${robot}`)));
    byId('modes').replaceChildren(...buttons);
  }

  fillTint() {
    const select = byId('tint'), label = byId('tint-label');
    const movable = this.scene && DATA.mapped ? DATA.things.map((name, thing) => [name, thing]).filter(([, thing]) =>
      DATA.states.some((_, state) => state < DATA.mapped && whereIs(state).at.has(thing))) : [];
    label.hidden = !movable.length;
    const kept = select.value || '-1';
    select.replaceChildren(make('option', { value: -1 }, 'nothing'), ...movable.map(([name, thing]) => make('option', { value: thing }, name)));
    select.value = [...select.options].some(o => o.value === kept) ? kept : '-1';
    select.onchange = () => this.show(this.transport.step);
  }

  fillSentences() {
    const { task } = this, plans = BigInt(task.plans);
    const row = (number, said, open, own) => make('button', { type: 'button', class: 'sentence', role: 'radio', 'data-sentence': number,
      onclick: () => this.choose(number), onkeydown: event => this.sentenceKey(event) },
    make('span', { class: 'said' }, ...said), make('span', { class: 'open', title: counted(open, 'plan') }, shortNumber(open)),
    make('span', { class: 'bar', style: `--share:${share(open, plans)}%` }), own ? make('span', { class: 'own' }, own) : null);
    byId('sentence-list').replaceChildren(
      row(-1, [make('span', {}, `All ${DATA.kept.plans}`)], plans, null),
      ...task.sentences.map((s, k) => row(k, s.words.map(chip), BigInt(s.plans), ownText(s, task))));
  }

  sentenceKey(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const rows = [...byId('sentence-list').children];
    const next = rows[(rows.indexOf(event.currentTarget) + step + rows.length) % rows.length];
    next.focus(); next.click();
  }

  choose(sentence) {
    this.sentence = sentence;
    const words = sentence < 0 ? null : this.task.sentences[sentence].words;
    this.fits = new Fits(this.task, this.wordOf, words);
    for (const row of byId('sentence-list').children) {
      const chosen = +row.dataset.sentence === sentence;
      row.setAttribute('aria-checked', chosen); row.tabIndex = chosen ? 0 : -1;
    }
    this.space.fits(this.fits);
    this.play(this.mode);
  }

  play(mode) {
    this.transport.pause();
    this.mode = mode;
    for (const button of byId('modes').children) button.setAttribute('aria-pressed', +button.dataset.mode === mode);
    this.transport.more = null;
    if (mode < 0) { this.setPlan(0n); return; }
    if (this.sentence < 0 && this.task.sentences.length) { this.choose(this.freest(mode)); return; }
    this.beliefs = [DATA.robots.map(() => new Set([0]))];
    this.nodes = [0]; this.edges = []; this.broken = null; this.rank = null;
    this.states = [this.task.nodes.state[0]]; this.steps = [];
    this.transport.more = () => this.act(null);
    this.transport.more.possible = () => !this.broken && this.edges.length < this.task.steps;
    this.transport.go(0);
  }

  // The listed sentence that leaves a robot most ways to go.
  freest(robot) {
    const ways = this.task.sentences.map(s => BigInt(s.own[robot] ?? 0));
    return ways.reduce((best, number, k) => (number > ways[best] ? k : best), 0);
  }

  setPlan(rank) {
    this.rank = rank; this.broken = null;
    this.edges = this.fits.unrank(rank);
    this.nodes = [0, ...this.edges.map(edge => this.task.target[edge])];
    this.states = this.nodes.map(node => this.task.nodes.state[node]);
    this.steps = this.edges.map(edge => this.task.labels.map(own => own[edge]));
    this.transport.go(Math.min(this.transport.step, this.states.length - 1));
  }

  visit(node) {
    const edges = this.fits.through(node) || new Fits(this.task, this.wordOf, null).through(node);
    if (!edges) return;
    this.transport.pause();
    if (!this.fits.through(node)) { this.mode = -1; this.choose(-1); } else if (this.mode >= 0) this.play(-1);
    this.transport.step = this.task.nodes.step[node];
    this.setPlan(this.fits.rank(edges));
  }

  // The robot that is played does `label` (null: any of its own), the others any of theirs; nobody looks at anybody.
  act(label) {
    const step = this.edges.length, random = this.random;
    const options = DATA.robots.map((_, robot) => this.fits.options(robot, this.beliefs[step][robot]));
    const labels = options.map((own, robot) => (robot === this.mode && label !== null ? label : [...own.keys()][random(own.size)]));
    const edge = edgeWith(this.task, this.nodes[step], labels);
    if (edge < 0) { this.broken = labels; this.transport.pause(); this.show(step); return; }
    this.beliefs.push(options.map((own, robot) => own.get(labels[robot])));
    this.edges.push(edge); this.steps.push(labels);
    this.nodes.push(this.task.target[edge]);
    this.states.push(this.task.nodes.state[this.task.target[edge]]);
    this.transport.go(step + 1);
  }

  chooseAt(step, label) {
    if (step < this.edges.length) {
      for (const list of [this.edges, this.steps]) list.length = step;
      for (const list of [this.nodes, this.states, this.beliefs]) list.length = step + 1;
    }
    this.broken = null;
    this.act(label);
  }

  show(step) {
    const { task } = this, state = this.states[step], word = DATA.state_words[state];
    const did = step ? this.steps[step - 1] : null;
    const begin = DATA.kept.unit === 'event' ? `events ${step}: ` : '';
    const doing = did ? begin + DATA.robots.map((r, k) => `${r}: ${DATA.labels[k][did[k]].short}`).join('; ') : 'start';
    byId('now-word').replaceChildren('now ', chip(word));
    if (this.scene) {
      const faded = new Set(this.mode < 0 ? [] : DATA.things.map((_, t) => t).filter(t => t < DATA.robots.length && t !== this.mode));
      this.scene.show(state, faded, `Step ${step} of ${task.steps}: ${told(state)}; word ${DATA.words[word].name}`);
      this.scene.trails(this.states, step);
      this.scene.tint(this.tintWords(state));
      this.scene.arrows(this.optionArrows(step));
    }
    byId('now').textContent = `${doing}. ${this.ending(step)}`;
    byId('now').title = told(state);
    this.space.plan(this.edges, step);
    this.atlas.now(state);
    this.showFacts(step); this.showChoices(step); this.showTimeline(step); this.showPlanNav();
  }

  ending(step) {
    if (this.broken && step === this.edges.length) {
      return `Now ${this.broken.map((label, r) => `${DATA.robots[r]} chose ${DATA.labels[r][label].short}`).join(' and ')}: that is not part of any ${DATA.kept.plan}.`;
    }
    if (step < this.task.steps) return '';
    return this.mode < 0 ? 'The goal is reached.' : `The goal is reached on ${DATA.kept.one}, and nobody had to ask.`;
  }

  optionArrows(step) {
    if (this.mode < 0 || step >= this.task.steps) return [];
    const own = this.fits.options(this.mode, this.beliefs[step][this.mode]);
    return [...own.keys()].flatMap(label => DATA.labels[this.mode][label].moves.map(([thing, place]) => [thing, place, false, this.mode]));
  }

  tintWords(state) {
    const thing = +byId('tint').value;
    if (!this.scene || thing < 0) return null;
    this.lookup ??= new Map(DATA.states.map((facts, number) => [facts.join(), number]).reverse());
    const at = [], base = DATA.states[state].filter(f => !(DATA.facts[f].role[0] === 'at' && DATA.facts[f].role[1] === thing));
    const before = DATA.states[state].find(f => DATA.facts[f].role[0] === 'at' && DATA.facts[f].role[1] === thing);
    if (before === undefined) return null;
    const predicate = DATA.facts[before].text.split(' ')[0];
    DATA.facts.forEach(({ role, text }, fact) => {
      if (role[0] !== 'at' || role[1] !== thing || text.split(' ')[0] !== predicate) return;
      const found = this.lookup.get([...base, fact].sort((a, b) => a - b).join());
      if (found !== undefined) at.push([role[2], DATA.state_words[found]]);
    });
    return new Map(at);
  }

  showFacts(step) {
    const now = new Set(DATA.states[this.states[step]]), before = new Set(step ? DATA.states[this.states[step - 1]] : now);
    const items = [];
    for (const fact of this.varying.facts) {
      const kind = now.has(fact) ? (before.has(fact) ? 'on' : 'new') : before.has(fact) ? 'gone' : null;
      if (kind) items.push(make('li', { class: kind }, DATA.facts[fact].text.replace(/^\((.*)\)$/, '$1')));
    }
    byId('facts').replaceChildren(...items);
  }

  showChoices(step) {
    const root = byId('choices');
    root.hidden = this.mode < 0 || step >= this.task.steps;
    if (root.hidden) return;
    const own = this.fits.options(this.mode, this.beliefs[step][this.mode]);
    root.className = `choices ${robotClass(this.mode)}`;
    const said = own.size === 1 ? 'has one way on:' : `may choose, whatever the others do:`;
    root.replaceChildren(make('span', { class: 'note' }, `${DATA.robots[this.mode]} ${said}`), ...[...own.keys()].map((label, k) =>
      make('button', { type: 'button', 'data-label': label, title: DATA.labels[this.mode][label].text, onclick: () => this.chooseAt(step, label) },
        k < 9 ? make('kbd', {}, k + 1) : null, DATA.labels[this.mode][label].short)));
  }

  showPlanNav() {
    const extra = this.transport.extra;
    if (this.mode >= 0) {
      extra.replaceChildren(make('button', { type: 'button', onclick: () => this.play(this.mode) }, 'Start again'),
        'The others choose by themselves, at random.');
      return;
    }
    const total = this.fits.total, turn = by => { this.transport.pause(); this.setPlan((this.rank + by + total) % total); };
    const many = total > 1n;
    extra.replaceChildren(`Plan ${shortNumber(this.rank + 1n)} of ${shortNumber(total)}${this.task.complete ? '' : ' in this page'}`,
      ...(many ? [make('button', { type: 'button', id: 'plan-back', onclick: () => turn(-1n) }, 'Previous'),
        make('button', { type: 'button', id: 'plan-next', onclick: () => turn(1n) }, 'Next'),
        make('button', { type: 'button', id: 'plan-random', onclick: () => { this.transport.pause(); this.setPlan(randomBelow(total, this.random)); } }, 'Random')] : []));
  }

  showTimeline(step) {
    const { states } = this, focus = document.activeElement?.dataset?.step;
    const words = [];
    states.forEach((state, k) => {
      const word = DATA.state_words[state];
      if (k && words.at(-1).word === word) words.at(-1).span++; else words.push({ word, span: 1 });
    });
    const rest = this.task.steps + 1 - states.length, blanks = () => Array.from({ length: rest }, () => make('td', { class: 'blank' }));
    const head = states.map((_, k) => make('td', { class: k === step ? 'current' : null },
      make('button', { type: 'button', 'data-step': k, 'aria-label': `Go to step ${k}`, onclick: () => { this.transport.pause(); this.transport.go(k); } }, k === 0 ? 'start' : k)));
    const rows = DATA.robots.map((robot, r) => make('tr', {}, make('th', { scope: 'row', class: robotClass(r) }, robot),
      ...states.map((state, k) => this.cell(r, k, step)), ...blanks()));
    // Without a common step the k-th events of the robots need not be at the k-th state.
    if (DATA.kept.unit === 'event') rows.unshift(make('tr', {}, make('th', { scope: 'row' }, 'event'), ...states.map((_, k) => make('td', {}, k || '')), ...blanks()));
    byId('timeline').replaceChildren(make('table', { class: 'timeline' }, make('thead', {}, make('tr', {}, make('th', {}, 'step'), ...head, ...blanks())),
      make('tbody', {}, make('tr', { class: 'said' }, make('th', { scope: 'row' }, 'word'),
        ...words.map(({ word, span }) => make('td', { colspan: span, class: wordClass(word) }, DATA.words[word].name))), ...rows)));
    if (focus !== undefined) byId('timeline').querySelector(`[data-step="${focus}"]`)?.focus({ preventScroll: true });
    const scroller = byId('timeline'), cell = scroller.querySelector('thead .current');
    if (cell && scroller.scrollWidth > scroller.clientWidth) scroller.scrollLeft = cell.offsetLeft - scroller.clientWidth / 2;
  }

  cell(robot, k, step) {
    const current = k === step ? 'current' : '';
    if (k === 0) {
      const place = whereIs(this.states[0]).at.get(robot);
      return make('td', { class: `idle ${current}` }, place === undefined ? '·' : DATA.places[place].name);
    }
    const { text, short, moves } = DATA.labels[robot][this.steps[k - 1][robot]];
    const own = moves.find(([thing]) => thing === robot);
    return make('td', { class: `${text === 'idle' ? 'idle' : ''} ${current}`, title: text },
      text === 'idle' ? '·' : own && moves.length === 1 && short.split(' ').length === 3 && /^(move|go|walk|drive|swing|fly|navigate)/.test(short)
        ? `→ ${DATA.places[own[1]].name}` : short);
  }
}

const share = (part, whole) => Number((part * 10000n) / (whole || 1n)) / 100;

// "3 ways for r1 x 4 for r2": the robots' own subplans, whose product are the plans where they all mix.
function ownText(sentence, task) {
  if (sentence.own.some(number => number === null)) return null;
  const product = sentence.own.reduce((p, n) => p * BigInt(n), 1n);
  const parts = sentence.own.map((n, r) => `${DATA.robots[r]} ${shortNumber(n)}`).join(' × ');
  return sentence.own.every(n => n === '1') ? 'nothing left to choose'
    : product === BigInt(sentence.plans) ? `ways to go: ${parts}` : `ways to go: ${parts}${mixing(sentence, task)}`;
}

// What is known of mixtures that do not have the sentence.
function mixing(sentence, task) {
  if (task.verified) return '; some mixtures have another sentence';
  const words = (task.violation ? task.violation.states[0] : []).map(state => DATA.state_words[state]);
  const said = words.filter((word, k) => word !== words[k - 1]);
  return said.join() === sentence.words.join() ? '; not all of them mix' : '';
}

// Facts that change within a task and are not seen on the map.
function varyingFacts(task) {
  const states = [...new Set(task.nodes.state)], seen = new Map();
  for (const state of states) for (const fact of DATA.states[state]) seen.set(fact, (seen.get(fact) || 0) + 1);
  const varying = [...seen].filter(([, number]) => number < states.length).map(([fact]) => fact).sort((a, b) => a - b);
  const map = DATA.places.length > 0;
  // What robots did last is in the timetable.
  const shown = varying.filter(fact => !DATA.kept.remembers || !DATA.facts[fact].text.startsWith('(last '));
  return { facts: shown.filter(fact => !map || !['at', 'with', 'mark'].includes(DATA.facts[fact].role[0])),
    marks: new Set(varying.map(fact => DATA.facts[fact].role).filter(role => role[0] === 'mark').map(role => role[2])) };
}
