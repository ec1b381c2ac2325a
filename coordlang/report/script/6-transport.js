// Play, pause, step, scrub: one clock for whatever is shown.

const ICONS = {
  back: 'M12 3 4 9l8 6z', forward: 'M6 3l8 6-8 6z', play: 'M4 2l12 7-12 7z', pause: 'M4 2h4v14H4zM10 2h4v14h-4z', again: 'M9 3a6 6 0 1 0 6 6h-2a4 4 0 1 1-4-4v3l5-4-5-4z',
};
const icon = name => draw('svg', { viewBox: '0 0 18 18', 'aria-hidden': true }, draw('path', { d: ICONS[name] }));

class Transport {
  // last(): number of the last step there is; total(): of the last one there will be; show(step): draw it.
  constructor(root, player, { last, show, total = last }) {
    Object.assign(this, { last, show, total, more: null, step: 0, timer: null });
    const button = (name, label, action) => make('button', { type: 'button', class: name, 'aria-label': label, title: label, onclick: action }, icon(name));
    this.playButton = button('play', 'Play', () => this.toggle());
    this.slider = make('input', { type: 'range', min: 0, value: 0, 'aria-label': 'Step', oninput: () => { this.pause(); this.go(+this.slider.value); } });
    this.output = make('output', {});
    this.extra = make('div', { class: 'plan-nav' });
    root.replaceChildren(button('back', 'One step back', () => { this.pause(); this.go(this.step - 1); }), this.playButton,
      button('forward', 'One step on', () => { this.pause(); this.forward(); }), this.slider, this.output, this.extra);
    player.addEventListener('keydown', event => this.key(event));
  }

  go(step) {
    this.step = Math.max(0, Math.min(this.last(), step));
    this.slider.max = this.last();
    this.slider.value = this.step;
    this.output.textContent = `step ${this.step} of ${this.total()}`;
    this.slider.setAttribute('aria-valuetext', this.output.textContent);
    this.show(this.step);
  }

  // One step further; where the end is open (`more`), something is chosen.
  forward() {
    if (this.step < this.last()) this.go(this.step + 1);
    else if (this.more?.possible()) this.more();
  }

  get atEnd() { return this.step >= this.last() && !this.more?.possible(); }

  toggle() {
    if (this.timer) { this.pause(); return; }
    if (this.atEnd) this.go(0);
    this.timer = setInterval(() => { this.forward(); if (this.atEnd) this.pause(); }, 850);
    this.paint();
  }

  pause() { clearInterval(this.timer); this.timer = null; this.paint(); }

  paint() {
    const name = this.timer ? 'pause' : 'play', label = this.timer ? 'Pause' : 'Play';
    this.playButton.replaceChildren(icon(name));
    this.playButton.setAttribute('aria-label', label);
    this.playButton.title = label;
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches('select, textarea')) return;
    const onButton = event.target.matches('button, summary, a');
    const actions = { ' ': () => this.toggle(), ArrowRight: () => { this.pause(); this.forward(); },
      ArrowLeft: () => { this.pause(); this.go(this.step - 1); }, Home: () => { this.pause(); this.go(0); }, End: () => { this.pause(); this.go(this.last()); } };
    if (!actions[event.key] || (event.key === ' ' && onButton)) return;
    event.preventDefault();
    actions[event.key]();
  }
}
