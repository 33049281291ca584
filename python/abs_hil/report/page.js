'use strict';
// Unpacks plotly.js and the figures, draws them in the colours of the reader's screen, and lets those over the same time
// zoom together.
(async function () {
  async function unpacked(id) {
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
    return new Response(stream).arrayBuffer();
  }
  if (typeof DecompressionStream === 'undefined') {
    for (const place of document.querySelectorAll('.plot')) place.textContent = 'The figures need a browser of 2023 or later.';
    return;
  }
  const script = document.createElement('script');  // the page's policy knows its checksum
  script.textContent = new TextDecoder().decode(await unpacked('plotly'));
  document.head.append(script);

  const buffer = await unpacked('plots');
  const length = new DataView(buffer).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(buffer, 4, length));
  const dark = JSON.parse(text).dark;
  const night = window.matchMedia('(prefers-color-scheme: dark)');
  const follows = document.getElementById('follow');
  const drawn = [];
  let linking = false;

  function numbers(key, value) {
    if (value === null || value.floats === undefined) return value;
    const kind = value.floats === 32 ? Float32Array : Float64Array;
    const begin = 4 + length + value.at;
    const flat = Array.from(new kind(buffer.slice(begin, begin + value.size * value.floats / 8)),
      (number) => (Number.isNaN(number) ? null : number));
    if (!value.columns) return flat;
    return Array.from({ length: value.size / value.columns }, (_, row) => flat.slice(row * value.columns, (row + 1) * value.columns));
  }

  // All plots, in the colours of a light or a dark page.
  function plots(isDark) {
    const coloured = isDark ? text.replace(/"(#[0-9a-fA-F]{6})"/g, (whole, colour) => `"${dark[colour] || colour}"`) : text;
    return JSON.parse(coloured, numbers).plots.map((plot) => ({ ...plot, layout: common(plot.layout, isDark) }));
  }

  function common(layout, isDark) {
    const colour = (light) => (isDark ? dark[light] : light);
    layout.font = { family: '"Liberation Serif", "Times New Roman", Times, serif', size: 14, color: colour('#1a1a1a') };
    layout.hovermode = layout.hovermode || 'x unified';
    layout.hoverlabel = { font: { size: 12, color: colour('#1a1a1a') }, bgcolor: colour('#ffffff'), namelength: 40 };
    layout.dragmode = 'zoom';
    layout.paper_bgcolor = layout.plot_bgcolor = colour('#ffffff');
    layout.autosize = true;
    for (const name of Object.keys(layout)) {
      if (!/^[xy]axis/.test(name)) continue;
      Object.assign(layout[name], { zeroline: false, gridcolor: colour('#e4e4e4'), linecolor: colour('#333333'), mirror: true,
        ticks: 'outside', ticklen: 4, automargin: false, ...layout[name] });
    }
    return layout;
  }

  const axes = (layout) => Object.keys(layout).filter((name) => /^yaxis/.test(name) && !layout[name].fixedrange);

  // The y axes over what the curves have between two instants; their own ranges without the switch.
  function fitted(made, low, high) {
    const change = {};
    for (const name of axes(made.place.layout)) {
      const first = made.ranges[name];
      change[`${name}.autorange`] = first === undefined;
      if (first !== undefined) change[`${name}.range`] = first.slice();
      if (!follows || !follows.checked || made.place.layout[name].type === 'log') continue;
      let least = Infinity, greatest = -Infinity;
      for (const trace of made.place.data) {
        if (`yaxis${trace.yaxis.slice(1)}`.replace(/axis1$/, 'axis') !== name || trace.visible === 'legendonly') continue;
        trace.x.forEach((x, i) => {
          if (x < low || x > high || trace.y[i] === null) return;
          least = Math.min(least, trace.y[i]);
          greatest = Math.max(greatest, trace.y[i]);
        });
      }
      if (least > greatest) continue;
      const room = 0.05 * (greatest - least) || 0.05 * Math.abs(greatest) || 0.5;
      change[`${name}.autorange`] = false;
      change[`${name}.range`] = [least - room, greatest + room];
    }
    return change;
  }

  function show(made, range) {
    return Plotly.relayout(made.place, { 'xaxis.range': range.slice(), 'xaxis.autorange': false,
      ...fitted(made, range[0], range[1]) });
  }

  // A zoom along x of one figure holds for all over the same axis. Both ends come together or not at all.
  function follow(source, change) {
    const given = change['xaxis.range'] || [change['xaxis.range[0]'], change['xaxis.range[1]']];
    const whole = change['xaxis.autorange'];
    if (linking || (given[0] === undefined && !whole)) return;
    linking = true;
    const y_too = Object.keys(change).some((name) => /^yaxis/.test(name));  // a drag over a rectangle is as it is
    const others = drawn.filter((other) => other.range.length && other.axis === source.axis && (other !== source || whole || !y_too));
    Promise.all(others.map((other) => show(other, whole ? other.range : given))).finally(() => { linking = false; });
  }

  function draw(plot) {
    const place = document.getElementById('plot-' + plot.id);
    plot.layout.height = plot.height;
    const made = { place: place, axis: plot.axis, range: (plot.layout.xaxis.range || []).slice(), ranges: {} };
    for (const name of axes(plot.layout)) made.ranges[name] = plot.layout[name].range && plot.layout[name].range.slice();
    return Plotly.newPlot(place, plot.data, plot.layout,
      { responsive: true, displaylogo: false, modeBarButtonsToRemove: ['select2d', 'lasso2d', 'autoScale2d'] })
      .then(() => {
        drawn.push(made);
        place.on('plotly_relayout', (change) => follow(made, change));
      });
  }

  function recolour(isDark) {
    for (const plot of plots(isDark)) {
      const place = document.getElementById('plot-' + plot.id);
      plot.layout.height = plot.height;
      for (const name of Object.keys(plot.layout)) {
        if (/^[xy]axis/.test(name) && place.layout[name].range) plot.layout[name].range = place.layout[name].range;
      }
      Plotly.react(place, plot.data, plot.layout);
    }
  }

  // One after the other, so that the first figures can be read while the last are drawn.
  for (const plot of plots(night.matches)) await draw(plot);
  document.body.dataset.drawn = String(drawn.length);
  if (follows) {
    follows.addEventListener('change', () => drawn.forEach((made) => {
      if (made.range.length) show(made, made.place.layout.xaxis.range.map(Number));
    }));
  }
  night.addEventListener('change', () => recolour(night.matches));
  window.addEventListener('beforeprint', () => {
    if (night.matches) recolour(false);
    drawn.forEach((made) => Plotly.Plots.resize(made.place));
  });
  window.addEventListener('afterprint', () => { if (night.matches) recolour(true); });
})();
