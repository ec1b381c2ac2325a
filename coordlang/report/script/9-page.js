// Everything put together.

function fillTasks(select) {
  const groups = [['Given', t => t.name !== null], ['Requires coordination', t => t.name === null && t.requires],
    ['Requires none', t => t.name === null && t.requires === false], ['Not decided', t => t.name === null && t.requires === null]];
  for (const [label, belongs] of groups) {
    const options = DATA.tasks.map((task, number) => [task, number]).filter(([task]) => belongs(task))
      .map(([task, number]) => make('option', { value: number }, cut((task.name ? `${task.name}: ` : '') + task.title, 90)));
    if (options.length) select.append(make('optgroup', { label }, ...options));
  }
}

function tasksNote() {
  const { count, others, looked, requiring, complete } = DATA.candidates, drawn = DATA.tasks.filter(t => t.name === null).length;
  if (complete) return drawn ? `All ${counted(count, 'candidate task')} of the language can be chosen.` : '';
  return `${grouped(DATA.tasks.length - others)} tasks of ${grouped(count)}${others ? ` and ${counted(others, 'other')}` : ''}: those given, and ${drawn} drawn at random `
    + `(of ${grouped(looked)} drawn, ${grouped(requiring)} require coordination; such tasks were preferred).`;
}

document.body.append(hatches());
const atlas = new Atlas(byId('atlas'));
const taskView = new TaskView(atlas), withoutView = new WithoutView();
const select = byId('task-select');

function openTask(number) {
  select.value = number;
  taskView.open(DATA.tasks[number]);
  withoutView.open(DATA.tasks[number]);
}

fillTasks(select);
byId('tasks-note').textContent = tasksNote();
select.addEventListener('change', () => openTask(+select.value));
const nextTask = byId('task-next');
nextTask.hidden = DATA.tasks.length < 2;
nextTask.addEventListener('click', () => {
  const order = [...select.options].map(option => +option.value);
  openTask(order[(order.indexOf(+select.value) + 1) % order.length]);
});
for (const row of document.querySelectorAll('.word-row')) {
  row.addEventListener('click', () => {
    const chosen = row.getAttribute('aria-pressed') !== 'true';
    for (const other of document.querySelectorAll('.word-row')) other.setAttribute('aria-pressed', chosen && other === row);
    atlas.only(chosen ? +row.dataset.word : null);
  });
}
document.addEventListener('keydown', event => {
  if (/^[1-9]$/.test(event.key) && !event.ctrlKey && !event.altKey && !event.metaKey && !event.target.matches('select, input')) {
    document.querySelectorAll('#choices:not([hidden]) button')[+event.key - 1]?.click();
  } else if (event.target === document.body) taskView.transport.key(event);
});
openTask(0);
