// Choices, sliders and fields of one run, made from the rows of the program's options: unit, range, default, meaning.
const STEPS = 1000;
const ROADS = [['the same grip everywhere', ''],
  ['grip halves from 4 to 6 m of braking', 'braking distance: 1; 0.5 at 4; 1 from 6 to 7'],
  ['grip falls to 0.4 after 5 m of braking', 'braking distance: 1; 0.4 at 5'],
  ['grip rises from 0.5 to 1 after 5 m of braking', 'braking distance: 0.5; 1 at 5'],
  ['grip changes every 3 m of braking', 'braking distance: 1; 0.6 at 3; 1 at 6; 0.6 at 9; 1 at 12; 0.6 at 15']];
const GROUPS = [
  ['Controller', ['control.slip_ref', 'control.rate_Hz']],  // and the controller's own options
  ['Tyre and road', ['plant.friction_profile', 'plant.theta_N', 'plant.B', 'plant.C']],
  ['Brake and encoders', ['plant.c31_per_s', 'plant.brake_dead_time_s', 'plant.brake_hysteresis', 'plant.ideal_actuator',
    'plant.encoder_counts_per_rev', 'plant.ideal_sensors']],
  ['What the controller believes', ['model.theta_N', 'model.B', 'model.C', 'model.c31_per_s']],
  ['Experiment', ['experiment.start_speed_rad_s', 'experiment.end_speed_m_s', 'run.seed']]];

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name in made && name !== 'list') made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

const short = (value, digits = 4) => (value == null || Number.isNaN(value) ? '–' : String(+(+value).toPrecision(digits)));

// A slider's ends: where a search for gains looks, otherwise around the default. {least, most, log}
function ends(key, value) {
  if (key.search) return { least: key.search[0], most: key.search[1], log: key.search[2] };
  const { least, most } = key.range;
  if (most - least <= 2) return { least: Math.max(least, key.range.least_open ? (most - least) / 1000 : least), most, log: false };
  if (value > 0) return { least: Math.max(least, value / 5), most: Math.min(most, value * 5), log: true };
  if (value < 0) return { least: Math.max(least, value * 3), most: Math.min(most, -value), log: false };
  return { least: Math.max(least, least < 0 ? -10 : 0), most: Math.min(most, 100), log: false };
}

const valueAt = ({ least, most, log }, place) =>
  +(log ? least * (most / least) ** (place / STEPS) : least + (most - least) * place / STEPS).toPrecision(4);
function placeOf({ least, most, log }, value) {
  const share = log ? Math.log(value / least) / Math.log(most / least) : (value - least) / (most - least);
  return Math.round(STEPS * Math.min(1, Math.max(0, share)));
}

class Option {
  // changed(name, value): value undefined takes the option back to its default
  constructor(key, start, changed) {
    this.key = key;
    this.changed = changed;
    const id = `option-${key.name.replaceAll('.', '-')}`;
    this.label = element('label', { htmlFor: id, title: key.name, textContent: key.name.split('.').at(-1) });
    this.reset = element('button', { type: 'button', className: 'reset', textContent: '↺', title: 'take the default back',
      'aria-label': `take the default of ${key.name} back`, onclick: () => changed(key.name, undefined) });
    const about = element('span', { className: 'about', id: `${id}-about`,
      textContent: `${key.meaning}${key.range ? `; ${key.range.text}` : ''}${key.unit ? ` ${key.unit}` : ''}` });
    this.fields(id, start);
    this.field.setAttribute('aria-describedby', about.id);
    this.element = element('div', { className: 'option' }, this.label, ...(this.slider ? [this.slider] : []), this.field,
      element('span', { className: 'unit', textContent: key.unit }), this.reset, about);
  }

  fields(id, start) {
    const { key } = this;
    const take = () => this.changed(key.name, this.value());
    if (key.type === 'flag') {
      this.field = element('input', { type: 'checkbox', id, onchange: take });
    } else if (key.name.endsWith('friction_profile')) {
      this.label.textContent = 'road';
      this.field = element('select', { id, onchange: take },
        ...ROADS.map(([name, value]) => element('option', { value, textContent: name })));
    } else if (key.type === 'text') {
      this.field = key.allowed && key.allowed.length < 30
        ? element('select', { id, onchange: take },
          ...key.allowed.map((value) => element('option', { value, textContent: value })))
        : element('input', { type: 'text', id, onchange: take });
    } else {
      this.field = element('input', { type: 'number', id, step: 'any', onchange: take });
      if (key.name !== 'run.seed') this.makeSlider(start);
    }
  }

  makeSlider(start) {
    this.ends = ends(this.key, +start);
    this.slider = element('input', { type: 'range', min: 0, max: STEPS, step: 1, 'aria-label': this.key.name, oninput: () => {
      const value = valueAt(this.ends, +this.slider.value);
      this.field.value = this.key.type === 'integer' ? Math.round(value) : value;
      this.changed(this.key.name, this.value());
    } });
  }

  value() {
    if (this.key.type === 'flag') return this.field.checked;
    if (this.key.type === 'text') return this.field.value;
    return this.field.value === '' ? undefined : this.key.type === 'integer' ? Math.round(+this.field.value) : +this.field.value;
  }

  show(value, given) {
    this.reset.disabled = !given;
    this.element.classList.toggle('given', given);
    if (this.key.type === 'flag') {
      this.field.checked = value === true || value === 'true';
    } else {
      if (this.field.tagName === 'SELECT' && ![...this.field.options].some((option) => option.value === String(value))) {
        this.field.append(element('option', { value, textContent: value }));
      }
      if (document.activeElement !== this.field || this.field.tagName === 'SELECT') this.field.value = value;
    }
    if (!this.slider) return;
    if (document.activeElement !== this.slider) this.slider.value = placeOf(this.ends, +value);
    this.slider.setAttribute('aria-valuetext', `${short(value)} ${this.key.unit}`.trim());
  }
}

// The form of the chosen run. It is made anew when the run or its controller changes.
class Controls {
  constructor(place, tables, exercise, changed) {
    Object.assign(this, { place, tables, exercise, changed, options: new Map(), more: new Set() });
    this.keys = new Map(tables.keys.map((key) => [key.name, key]));
  }

  groups(run) {
    const offered = this.exercise?.offered.keys;
    if (offered?.length) return [['What you may change', offered]];
    const section = this.tables.controllers.find(({ name }) => name === run.controller)?.section ?? '-';
    const own = this.tables.keys.map(({ name }) => name).filter((name) => name.startsWith(section));
    const groups = GROUPS.map(([title, names], n) => [title, n ? names : [...names, ...own]]);
    const shown = new Set(groups.flatMap(([, names]) => names));
    const others = [...new Set([...Object.keys(run.set), ...this.more])]
      .filter((name) => !shown.has(name) && this.keys.has(name));
    return [...groups, ['Other options', others]];
  }

  choice(name, run) {
    const rows = this.tables[`${name}s`];
    const offered = this.exercise?.offered[`${name}s`];
    const choices = rows.filter((row) => !offered?.length || offered.includes(row.name));
    const about = element('span', { className: 'about', id: `choice-${name}-about`,
      textContent: rows.find((row) => row.name === run[name])?.meaning ?? '' });
    const select = element('select', { id: `choice-${name}`, 'aria-describedby': about.id, disabled: choices.length < 2,
      onchange: () => this.changed(name, select.value) }, ...choices.map((row) =>
      element('option', { value: row.name, textContent: nameOf(row.name), title: row.meaning, selected: row.name === run[name] })));
    if (select.value !== run[name]) {
      select.append(element('option', { value: run[name], textContent: run[name], selected: true }));
    }
    return element('div', { className: 'option choice' },
      element('label', { htmlFor: select.id, textContent: name }), select, about);
  }

  build(run, values) {
    const focused = document.activeElement?.id;
    this.options.clear();
    this.place.replaceChildren(...CHOICES.map((name) => this.choice(name, run)));
    this.groups(run).forEach(([title, names], n) => {
      const hidden = this.exercise?.hidden.set ?? {};
      const rows = names.filter((name) => this.keys.has(name) && !(name in hidden)).map((name) => {
        const key = this.keys.get(name);
        const option = new Option(key, run.set[name] ?? values.get(name) ?? key.value, this.changed);
        this.options.set(name, option);
        return option.element;
      });
      if (!rows.length) return;
      this.place.append(element('details', { open: n < 2 || title === 'Other options' },
        element('summary', { textContent: title }), ...rows));
    });
    if (!this.exercise) this.place.append(this.finder(run, values));
    this.show(run, values);
    if (focused) document.getElementById(focused)?.focus();
  }

  // Any option of the program, by name.
  finder(run, values) {
    const list = element('datalist', { id: 'all-options' }, ...this.tables.keys.map(({ name, meaning }) =>
      element('option', { value: name, textContent: meaning })));
    const field = element('input', { type: 'text', id: 'find-option', list: list.id, placeholder: 'plant.J2_kg_m2' });
    field.addEventListener('change', () => {
      if (!this.keys.has(field.value)) return;
      this.more.add(field.value);
      this.build(run, values);
      this.options.get(field.value)?.field.focus();
    });
    return element('div', { className: 'option choice' },
      element('label', { htmlFor: field.id, textContent: 'add an option' }), field, list);
  }

  // A value that nobody has set is the plant's, the experiment's or the program's; a model's follows its plant.
  show(run, values) {
    for (const [name, option] of this.options) {
      const standard = values.get(name) ?? values.get(name.replace(/^model\./, 'plant.')) ?? option.key.value;
      option.show(run.set[name] ?? standard, name in run.set);
    }
  }
}
