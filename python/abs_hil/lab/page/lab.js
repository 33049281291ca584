// The page: what is chosen, the runs that follow from it, and what is drawn of them.
async function lab() {
  const page = JSON.parse(await (await unpacked('page')).text());
  const { exercise } = page;
  const hidden = exercise?.hidden ?? { set: {}, columns: [], figures: [] };
  const engine = await Engine.load();
  const at = (id) => document.getElementById(id);
  const state = { runs: runsOf(location.hash, exercise), chosen: 0, results: [], time: 0.5, whole: false, playing: false };

  const figures = new Figures(at('charts'), hidden.columns, (time) => { play(false); moment(time, false); });
  const wheels = new Wheels(at('wheels'), at('wheels-text'));
  const controls = new Controls(at('controls'), engine.tables, exercise, change);

  // ---- runs
  function compute(number) {
    const run = state.runs[number];
    try {
      state.results[number] = engine.run(wordsOf(run, hidden.set));
      run.problem = '';
    } catch (error) {
      run.problem = error.message;
      state.results[number] ??= engine.run(wordsOf(firstRun(exercise), hidden.set));  // of a link: something is drawn
    }
  }

  const values = () => state.results[state.chosen].values;

  function change(name, value) {
    const run = state.runs[state.chosen];
    const rebuild = CHOICES.includes(name);
    if (rebuild) run[name] = value;
    else if (value === undefined) delete run.set[name];
    else run.set[name] = value;
    state.rebuild ||= rebuild;
    soon();
  }

  // Once for each picture of the screen, however fast a slider moves.
  function soon() {
    if (state.waiting) return;
    state.waiting = true;
    requestAnimationFrame(() => {
      state.waiting = false;
      compute(state.chosen);
      if (state.rebuild) controls.build(state.runs[state.chosen], values());
      state.rebuild = false;
      draw();
    });
  }

  function draw() {
    const runs = state.results;
    const problems = state.runs.map(({ problem }, n) => problem && `run ${n + 1}: ${problem}`).filter(Boolean);
    at('problem').textContent = problems.join(' ');
    at('problem').hidden = !problems.length;
    figures.draw(runs, state.whole);
    drawGoals(drawFigures(at('figures'), engine.tables.figures, runs, hidden.figures, exercise?.goals ?? []));
    controls.show(state.runs[state.chosen], values());
    wheels.use(runs[state.chosen]);
    bounds();
    moment(state.time, true);
    const run = state.runs[state.chosen];
    at('line-simulator').value = simulatorLine(run);
    at('line-rig').value = rigLine(run);
    history.replaceState(null, '', linkOf(state.runs));
    if (!document.body.dataset.drawn) performance.mark('first figure');
    document.body.dataset.drawn = +(document.body.dataset.drawn ?? 0) + 1;
  }

  function drawGoals(goals) {
    at('goals').replaceChildren(...goals.map(({ says, met }) =>
      element('li', { className: met ? 'met' : '', textContent: `${met ? '✓ reached' : '○ not yet'}: ${says}` })));
  }

  function add() {
    state.runs.push(copyOf(state.runs[state.chosen]));
    choose(state.runs.length - 1, true);
  }

  function remove() {
    state.runs.splice(state.chosen, 1);
    state.results.splice(state.chosen, 1);
    choose(Math.max(0, state.chosen - 1));
  }

  function tabs() {
    const button = (textContent, onclick, more) => element('button', { type: 'button', textContent, onclick, ...more });
    at('runs').replaceChildren(...state.runs.map((_, n) => button(`run ${n + 1}`, () => choose(n),
      { className: `tab run-${n + 1}`, 'aria-pressed': String(n === state.chosen) })));
    if (state.runs.length < MOST_RUNS) {
      at('runs').append(button('+ run', add, { id: 'add-run', title: 'another run with the values of this one' }));
    }
    if (state.runs.length > 1) at('runs').append(button('− run', remove, { id: 'remove-run', title: 'take this run away' }));
  }

  function choose(number, fresh = false) {
    state.chosen = number;
    if (fresh) compute(number);
    tabs();
    controls.build(state.runs[number], values());
    draw();
  }

  // ---- the moment
  function bounds() {
    const run = state.results[state.chosen];
    const time = run.columns.get('time_s').values;
    const slider = at('moment');
    slider.min = (state.whole ? time[0] : Math.max(time[0], braked(run) - BEFORE_S)) - braked(run);
    slider.max = time.at(-1) - braked(run);
    slider.step = run.values.get('control.rate_Hz') ? 1 / run.values.get('control.rate_Hz') : 0.001;
    state.time = Math.min(Math.max(state.time, +slider.min), +slider.max);
  }

  function moment(time, mark) {
    state.time = time;
    at('moment').value = time;
    at('moment').setAttribute('aria-valuetext', `${short(time)} s`);
    drawWhy(at('why'), engine.tables, state.results, time, hidden);
    wheels.show(time);
    if (mark) figures.mark(time);
  }

  // Who looks at a moment stops the wheels.
  function play(on) {
    if (!on && !state.playing) return;
    state.playing = on;
    at('play').setAttribute('aria-pressed', String(on));
    at('play').textContent = on ? 'stop the wheels' : 'turn the wheels';
    cancelAnimationFrame(state.frame);
    let before = performance.now();
    const turn = (now) => {
      const time = state.time + (now - before) / 1000 / SLOWER;
      before = now;
      moment(time > +at('moment').max ? +at('moment').min : time, true);
      state.frame = requestAnimationFrame(turn);
    };
    if (on) state.frame = requestAnimationFrame(turn);
  }

  // ---- files
  function save(name, text, type) {
    const link = element('a', { href: URL.createObjectURL(new Blob([text], { type })), download: name });
    link.click();
    URL.revokeObjectURL(link.href);
  }

  function csv() {
    const lines = engine.csv(wordsOf(state.runs[state.chosen], hidden.set)).trimEnd().split('\n').map((line) => line.split(','));
    const kept = [...lines[0].keys()].filter((place) => !hidden.columns.includes(lines[0][place]));
    const text = lines.map((cells) => kept.map((place) => cells[place]).join(',')).join('\n');
    save(`run-${state.chosen + 1}.csv`, `${text}\n`, 'text/csv');
  }

  function experiment() {
    const run = state.runs[state.chosen];
    const { text } = engine.tables.experiments.find(({ name }) => name === run.experiment);
    save('lab-experiment.toml', experimentFile(run, text, controls.keys), 'application/toml');
  }

  // A reader's own experiment. Each file is another one, because the program reads each once.
  async function own(file) {
    const text = await file.text();
    const name = `/given/${engine.tables.experiments.length}/${file.name}`;
    engine.give(name, text);
    engine.tables.experiments.push({ name, meaning: `your file ${file.name}`, text });
    change('experiment', name);
  }

  async function copy(button, text) {
    const before = button.textContent;
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = 'copied';
    } catch {
      button.textContent = 'select the text and copy it';  // a browser may refuse
    }
    setTimeout(() => { button.textContent = before; }, 1500);
  }

  at('controls').addEventListener('submit', (event) => event.preventDefault());
  at('whole').addEventListener('change', () => { state.whole = at('whole').checked; draw(); });
  at('moment').addEventListener('input', () => { play(false); moment(+at('moment').value, true); });
  at('play').addEventListener('click', () => play(!state.playing));
  at('own-experiment')?.addEventListener('change', ({ target }) => {
    if (target.files[0]) own(target.files[0]);
    target.value = '';  // the same file may come again, with other contents
  });
  at('save-csv').addEventListener('click', csv);
  at('save-experiment').addEventListener('click', experiment);
  at('copy-link').addEventListener('click', () => copy(at('copy-link'), location.href));
  at('copy-simulator').addEventListener('click', () => copy(at('copy-simulator'), at('line-simulator').value));
  addEventListener('hashchange', () => {
    if (location.hash === linkOf(state.runs)) return;
    Object.assign(state, { runs: runsOf(location.hash, exercise), chosen: 0, results: [] });
    state.runs.forEach((_, n) => compute(n));
    choose(0);
  });

  state.runs.forEach((_, n) => compute(n));
  choose(0);
  return { engine, state, figures };
}

window.lab = lab().catch((error) => {
  const problem = document.getElementById('problem');
  problem.hidden = false;
  problem.textContent = `The lab cannot start: ${error.message}. It needs a browser of 2023 or later with WebAssembly.`;
  throw error;
});
