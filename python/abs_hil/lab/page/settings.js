// What a run is made with: choices and set options, as words of the command line, in the page's link, as files.
const CHOICES = ['controller', 'plant', 'experiment'];
const MOST_RUNS = 3;
const FIRST = { controller: 'adaptive', plant: 'paper-table1', experiment: 'paper', set: { 'experiment.start_speed_rad_s': 170 } };

const copyOf = (run) => ({ ...run, set: { ...run.set } });

function firstRun(exercise) {
  if (!exercise) return copyOf(FIRST);
  return { ...FIRST, ...exercise.start, set: { ...exercise.start.set } };
}

// Words that the page shows; what an exercise hides comes only with `hidden`.
function wordsOf(run, hidden = {}) {
  const words = CHOICES.flatMap((choice) => [`--${choice}`, run[choice]]);
  for (const [key, value] of Object.entries({ ...run.set, ...hidden })) words.push('--set', `${key}=${value}`);
  return words;
}

const quoted = (word) => (/^[\w./=:+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);
const commandOf = (words) => words.map(quoted).join(' ');

// Of a reader's own experiment the file's name without the folder that it has in the page.
const nameOf = (experiment) => experiment.split('/').at(-1);

// The same run in the simulator, from the experiment's file and these words.
function simulatorLine(run) {
  return `abs_hil --fast --no-lcm ${commandOf(wordsOf({ ...run, experiment: nameOf(run.experiment) }))} --out runs/lab`;
}

// A rig has no plant to set, and its wheels stand at first.
const onRig = (key) => !key.startsWith('plant.') && key !== 'experiment.start_speed_rad_s' && key !== 'run.seed';

function rigLine(run) {
  const words = ['--backend', 'rig', '--model', run.plant, '--controller', run.controller, '--experiment', nameOf(run.experiment)];
  for (const [key, value] of Object.entries(run.set)) if (onRig(key)) words.push('--set', `${key}=${value}`);
  return `abs_hil ${commandOf(words)} --out runs/rig`;
}

function toml(key, value, keys) {
  return `"${key}" = ${keys.get(key)?.type === 'text' ? JSON.stringify(value) : value}`;
}

// An experiment's file with the settings that do not belong to a plant.
function experimentFile(run, text, keys) {
  const lines = [`"control.controller" = ${JSON.stringify(run.controller)}`];
  for (const [key, value] of Object.entries(run.set)) if (onRig(key)) lines.push(toml(key, value, keys));
  const settings = `[settings]\n${lines.join('\n')}\n`;
  return /^\[settings\]$/m.test(text) ? text.replace(/^\[settings\]$/m, settings.trimEnd()) : `${text.trimEnd()}\n\n${settings}`;
}

// ---- the link: #controller=adaptive&plant=...&control.slip_ref=0.2&&controller=... , one part for each run
function linkOf(runs) {
  return '#' + runs.map((run) => new URLSearchParams(
    [...CHOICES.map((choice) => [choice, run[choice]]), ...Object.entries(run.set)]).toString()).join('&&');
}

function runsOf(link, exercise) {
  const runs = link.replace(/^#/, '').split('&&').filter(Boolean).slice(0, MOST_RUNS).map((part) => {
    const run = { ...firstRun(exercise), set: {} };
    for (const [key, value] of new URLSearchParams(part)) {
      if (CHOICES.includes(key)) run[key] = value;
      else if (!exercise || !(key in exercise.hidden.set)) run.set[key] = value;
    }
    return run;
  });
  return runs.length ? runs : [firstRun(exercise)];
}
