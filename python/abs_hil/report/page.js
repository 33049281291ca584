'use strict';
// Draws the figures of a report and lets those over the same time zoom together. plotly.js stands before this script.
(function () {
  const kinds = { f4: Float32Array, f8: Float64Array };
  function numbers(packed) {
    const text = atob(packed.data);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
    return Array.from(new kinds[packed.type](bytes.buffer), (value) => (Number.isNaN(value) ? null : value));
  }
  const plots = JSON.parse(document.getElementById('plots').textContent);
  const drawn = [];
  let linking = false;

  function common(layout) {
    layout.font = { family: '"Liberation Serif", "Times New Roman", Times, serif', size: 14, color: '#1a1a1a' };
    layout.hovermode = 'x unified';
    layout.hoverlabel = { font: { size: 12 }, namelength: 40 };
    layout.dragmode = 'zoom';
    layout.paper_bgcolor = layout.plot_bgcolor = '#ffffff';
    layout.autosize = true;
    for (const name of Object.keys(layout)) {
      if (!/^[xy]axis/.test(name)) continue;
      Object.assign(layout[name], { zeroline: false, gridcolor: '#e4e4e4', linecolor: '#333333', mirror: true,
        ticks: 'outside', ticklen: 4, automargin: false });
      if (name[0] === 'x') layout[name].hoverformat = '.4~f';
    }
    return layout;
  }

  // A zoom along x of one figure holds for all others over the same axis. Both ends come together or not at all.
  function follow(source, change) {
    const given = change['xaxis.range'] || [change['xaxis.range[0]'], change['xaxis.range[1]']];
    const whole = change['xaxis.autorange'];
    if (linking || (given[0] === undefined && !whole)) return;
    linking = true;
    const others = drawn.filter((other) => other !== source && other.axis === source.axis);
    Promise.all(others.map((other) => Plotly.relayout(other.place,
      { 'xaxis.range': whole ? other.range.slice() : given.slice(), 'xaxis.autorange': false })))
      .then(() => (whole ? Plotly.relayout(source.place, { 'xaxis.range': source.range.slice() }) : null))
      .finally(() => { linking = false; });
  }

  function draw(plot) {
    const place = document.getElementById('plot-' + plot.id);
    for (const trace of plot.data) {
      trace.x = numbers(trace.x);
      trace.y = numbers(trace.y);
      trace.type = 'scatter';
      if (trace.meta) trace.hovertemplate = '%{y:.5~g}';
    }
    const layout = common(plot.layout);
    layout.height = plot.height;
    const made = { place: place, axis: plot.axis, range: (layout.xaxis.range || []).slice() };
    return Plotly.newPlot(place, plot.data, layout,
      { responsive: true, displaylogo: false, modeBarButtonsToRemove: ['select2d', 'lasso2d', 'autoScale2d'] })
      .then(() => {
        drawn.push(made);
        place.on('plotly_relayout', (change) => follow(made, change));
      });
  }

  // One after the other, so that the first figures can be read while the last are drawn.
  plots.reduce((before, plot) => before.then(() => draw(plot)), Promise.resolve())
    .then(() => { document.body.dataset.drawn = String(drawn.length); });
  window.addEventListener('beforeprint', () => drawn.forEach((made) => Plotly.Plots.resize(made.place)));
})();
