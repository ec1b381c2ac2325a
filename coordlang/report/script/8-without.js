// The miscoordination that the language prevents: each robot's plan, and what they do together.

class WithoutView {
  constructor() {
    this.transport = new Transport(byId('without-transport'), byId('without'), { last: () => this.last, show: step => this.show(step) });
  }

  open(task) {
    this.transport.pause();
    const witness = this.witness = task.violation || task.witness;
    this.task = task;
    byId('without-player').hidden = !witness;
    byId('without-note').textContent = !witness
      ? (task.requires === null ? 'Not decided for this task: it is too large.' : `In this task nothing can go wrong: any mixture of its ${DATA.kept.plans} is ${DATA.kept.one}.`)
      : task.violation ? 'These plans have one sentence, and yet they do not mix. Each robot follows its own part of another one.'
        : `Each robot knows the task and plans by itself, ${DATA.kept.one} each time, and follows its own part of it. Nobody has said a word.`;
    if (!witness) return;
    const impossible = witness.stops !== null;
    this.last = impossible ? witness.stops + 1 : witness.together.length - 1;
    const marks = varyingFacts(task).marks;
    this.acts = [...DATA.robots.map((robot, r) => this.makeAct(`${robot} follows`, witness.states[r], marks, r)),
      this.makeAct('Together they do', witness.together, marks, -1)];
    byId('acts').replaceChildren(...this.acts.map(act => act.root));
    this.transport.go(0);
  }

  makeAct(title, states, marks, robot) {
    const scene = DATA.places.length ? new Scene(title, marks, DATA.places.length <= 12) : null;
    if (scene) scene.goals(this.task.goals);
    const does = make('ul', { class: 'does' }), said = make('div', { class: 'said' });
    if (robot >= 0) {
      const words = states.map(s => DATA.state_words[s]).filter((w, k, all) => !k || all[k - 1] !== w);
      said.append(...words.map(chip));
    } else said.append('nobody has planned this');
    const root = make('div', { class: `act ${robot < 0 ? 'together' : robotClass(robot)}`, 'data-act': robot }, make('h3', {}, title), said, scene ? scene.svg : null, does);
    return { scene, states, robot, root, does };
  }

  show(step) {
    const { witness } = this, broken = witness.stops !== null && step > witness.stops;
    const late = witness.stops === null && step === this.last;
    for (const act of this.acts) {
      const together = act.robot < 0, at = Math.min(step, act.states.length - 1), state = act.states[at];
      const labels = step ? (together ? DATA.robots.map((_, r) => witness.plans[r][step - 1][r]) : witness.plans[act.robot][step - 1]) : null;
      if (act.scene) {
        const faded = new Set(together ? [] : DATA.robots.map((_, r) => r).filter(r => r !== act.robot));
        act.scene.show(state, faded, `${act.root.querySelector('h3').textContent}, step ${step}: ${told(state)}`);
        act.scene.trails(act.states.slice(0, at + 1), at);
        const tries = together && broken ? labels.flatMap((label, r) => DATA.labels[r][label].moves.map(([thing, place]) => [thing, place, true, r])) : [];
        act.scene.arrows(tries, tries.length ? [crossOf(act.scene, tries)] : []);
      }
      act.root.classList.toggle('broken', together && step > witness.breaks);
      act.does.replaceChildren(...(labels || DATA.robots.map(() => null)).map((label, r) => make('li', { class: robotClass(r) }, make('b', {}, DATA.robots[r]),
        make('span', { class: together || r === act.robot ? 'own' : 'expected', title: label === null ? null : DATA.labels[r][label].text }, label === null ? '–' : DATA.labels[r][label].short))),
      ...(act.scene ? [] : [make('li', {}, make('b', {}, ''), make('span', { class: 'expected' }, told(state)))]));
    }
    this.tell(step, broken, late);
  }

  tell(step, broken, late) {
    const { witness } = this, line = byId('verdict');
    const breaks = step > witness.breaks;
    line.classList.toggle('bad', breaks);
    line.textContent = broken ? `Step ${step} is not possible: ${witness.stops === witness.breaks ? witness.reason : witness.why}.`
      : late && !witness.reaches ? `After ${counted(step, 'step')} the goal is not reached. It went wrong in step ${witness.breaks + 1}: ${witness.reason}.`
        : late ? `The goal is reached, but not on ${DATA.kept.one}: ${witness.reason}.`
          : breaks ? `Step ${witness.breaks + 1} is on no ${DATA.kept.plan}: ${witness.reason}.` : step ? 'So far, so good.' : '';
  }
}

// Where attempted moves meet: the place that several want, else between the movers.
function crossOf(scene, tries) {
  const places = tries.map(([, place]) => place), shared = places.find((p, k) => places.indexOf(p) !== k);
  if (shared !== undefined) return scene.geometry.centre[shared];
  const spots = tries.map(([thing, place]) => {
    const [x, y] = scene.spots.get(thing) || scene.geometry.centre[place], [a, b] = scene.geometry.centre[place];
    return [(x + a) / 2, (y + b) / 2];
  });
  return [0, 1].map(k => spots.reduce((sum, spot) => sum + spot[k], 0) / spots.length);
}
