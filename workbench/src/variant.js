// The pane that holds the text beside the file as saved, or beside another model: both mechanisms over each other, what
// changed, and what that costs along the recordings.
(() => {
  'use strict';
  const { ask } = window.mill;
  const { make, number, percent, cell, asker, say } = window.bench;
  const by = (id) => document.getElementById(id);
  let stands = null, opened = null, isListed = false, command = null, shown = null;

  // ---- tables

  const table = (caption, heads, rows) => {
    const box = make('table');
    box.append(make('caption', caption));
    const head = box.createTHead().insertRow();
    heads.forEach((words, i) => head.appendChild(make('th', words, i ? 'number' : '')));
    box.createTBody().append(...rows);
    return box;
  };
  const short = (v) => (v === null || v === undefined ? '\u2014' : Number(v.toPrecision(4)).toString().replace('-', '\u2212'));
  const signed = (v) => (v < 0 ? `\u2212${percent(-v)}` : `+${percent(v)}`);
  const is_same = (a, b) => a === b || Math.abs(b - a) < 5e-6 * Math.abs(a);
  // What is after, and below it what was before and by how much it changed; more of anything but net work is worse.
  const change = (row, before, after) => {
    const box = cell(row, short(after), 'number');
    if (is_same(before, after)) { box.append(make('small', 'the same')); return; }
    const by_ = before ? `, ${signed((after - before) / Math.abs(before))}` : '';
    box.append(make('small', `was ${short(before)}${by_}`, Math.abs(after) > Math.abs(before) ? 'worse' : 'better'));
  };

  const efforts = (drives) => {
    const figures = ['peak', 'rms', 'peak_power', 'rms_power', 'work', 'net_work'];
    const heads = ['drive', 'peak force', 'rms force', 'peak power, W', 'rms power, W', 'work given, J', 'net work, J'];
    return table('What the drives give', heads, drives.map((one) => {
      const row = make('tr');
      cell(row, `${one.drive}, ${one.unit}`);
      for (const figure of figures) change(row, one.before[figure], one.after[figure]);
      return row;
    }));
  };

  const MOST = 6;
  const shares = (one) => {
    const size = `${one.drive}: ${short(one.difference.rms)} ${one.unit} rms, ${short(one.difference.peak)} ${one.unit} at most`;
    const terms = one.products.flatMap((product) => product.terms).sort((a, b) => Math.abs(b.share) - Math.abs(a.share));
    if (!terms.length) return make('p', `${one.drive}: no difference.`);
    const least = 0.01 * Math.abs(terms[0].share);
    const main = terms.filter((term, i) => i < MOST && Math.abs(term.share) >= least);
    const rows = main.map((term) => {
      const row = make('tr');
      row.appendChild(make('td')).appendChild(make('code', term.term));
      cell(row, signed(term.share), 'number');
      row.appendChild(make('td', undefined, 'number')).appendChild(make('code', term.retained));
      cell(row, `${number(term.before)} \u2192 ${number(term.after)} ${term.unit === '1' ? '' : term.unit}`, 'number');
      const isOfColumn = Math.abs(term.share - term.by_value) > 0.01 * Math.abs(term.share);
      cell(row, isOfColumn ? `${signed(term.by_value)} by its value, ${signed(term.share - term.by_value)} by its column` : '', 'number');
      return row;
    });
    if (main.length < terms.length) {
      const row = make('tr');
      cell(row, terms.length - main.length === 1 ? 'one other' : `${terms.length - main.length} others`);
      cell(row, signed(terms.slice(main.length).reduce((sum, term) => sum + term.share, 0)), 'number');
      rows.push(row);
    }
    return table(`What makes the difference of ${size}`, ['summand of p_min', 'share', 'in', 'value', ''], rows);
  };

  const limits = (all) => {
    const says = { now_exceeded: 'now exceeded', still_exceeded: 'exceeded by both', no_longer_exceeded: 'no longer exceeded', kept: 'kept' };
    const order = Object.keys(says);
    const marks = { now_exceeded: 'worse', no_longer_exceeded: 'better' };
    const rows = [...all].sort((a, b) => order.indexOf(a.crossing) - order.indexOf(b.crossing)).map((one) => {
      const row = make('tr', undefined, marks[one.crossing]);
      cell(row, one.limit);
      for (const side of [one.before, one.after]) cell(row, side.range ? side.range.map(short).join(' to ') : '\u2014', 'number');
      for (const side of [one.before, one.after]) cell(row, percent(side.used), 'number');
      cell(row, says[one.crossing], 'number');
      return row;
    });
    return table('Limits', ['limit', 'range before', 'range after', 'used before', 'used after', ''], rows);
  };

  const errors = ({ before, after }) => {
    const names = Object.keys((before || after).channels).concat(Object.keys((after || before).channels));
    const row = (name, of) => {
      const one = make('tr');
      cell(one, name);
      for (const figures of [before, after]) cell(one, figures ? percent(of(figures)) : '\u2014', 'number');
      return one;
    };
    const rows = [row('all drives', (f) => f.nrms)];
    for (const name of new Set(names)) rows.push(row(name, (f) => f.channels[name] && f.channels[name].nrms));
    return table('Error relative to the measured force', ['drive', 'before', 'after'], rows);
  };

  const operations = (all) => table('Operations of a call', ['function', 'before', 'after'], Object.entries(all).map(([name, { before, after }]) => {
    const row = make('tr');
    const words = (count) => Object.entries(count).filter(([, n]) => n).map(([what, n]) => `${n} ${what}`).join(', ');
    cell(row, name.replaceAll('_', ' '));
    cell(row, words(before), 'number');
    cell(row, words(after), 'number');
    return row;
  }));

  const entries = (told) => {
    const list = make('table');
    list.append(make('caption', 'Entries that changed'));
    const rows = told.entries.map((one) => {
      const row = make('tr');
      cell(row, one.name);
      cell(row, one.before === null ? 'new' : one.before);
      cell(row, one.after === null ? 'gone' : one.after);
      return row;
    });
    list.createTBody().append(...rows);
    return rows.length ? [list] : [];
  };

  // ---- what is asked

  const footer = () => {
    if (!stands || stands.pane !== 'variant') return;
    by('command').textContent = command || '';
    by('command').parentElement.hidden = !command;
  };

  const list = async () => {
    const { models, named } = await ask('models', {});
    const first = by('beside').options[0];
    const chosen = isListed ? by('beside').value : named || '';
    by('beside').replaceChildren(first, ...models.map((name) => new Option(name, name)));
    by('beside').value = models.includes(chosen) ? chosen : '';
    isListed = true;
  };

  const draw = async (beside) => {
    const { at, from } = stands.seen;
    by('both').innerHTML = await ask('picture', { at, from, names: true, frames: false, shadow: true, beside });
    for (const one of by('both').querySelectorAll('svg')) one.setAttribute('aria-label', 'The mechanism, the one before as a shadow');
  };

  const compare = asker('variant', async () => {
    if (!stands || stands.pane !== 'variant' || !stands.view.valid) return;
    const { view } = stands;
    const isOther = opened !== view.opened;
    if (isOther) { opened = view.opened; isListed = false; shown = null; by('costs').replaceChildren(); by('both').replaceChildren(); }
    if (!isListed) await list();
    const beside = by('beside').value || null;
    const asked = `${view.revision} ${beside} ${view.changed} ${JSON.stringify(stands.seen)}`;
    if (shown === asked) { footer(); return; }
    for (const id of ['costs', 'both']) by(id).classList.add('stale');
    const late = setTimeout(() => { by('variant-state').textContent = '\u2026'; }, 300);
    try {
      await draw(beside);
      const told = await ask('variant', { beside });
      const { along } = told;
      const pieces = [];
      if (told.same) pieces.push(make('p', 'Both texts are the same: what you edit shows here.'));
      if (told.refused) pieces.push(make('p', told.refused, 'alias'));
      if (along) {
        for (const note of along.notes) pieces.push(make('p', note.says, note.severity === 'warning' ? 'alias' : ''));
        if (along.limits.length) pieces.push(limits(along.limits));
        pieces.push(efforts(along.drives), ...along.drives.map(shares));
        if (along.errors.before || along.errors.after) pieces.push(errors(along.errors));
      } else if (!told.refused) pieces.push(make('p', window.mill.hint));
      pieces.push(...entries(told), operations(told.operations));
      by('costs').replaceChildren(...pieces);
      by('costs').dataset.revision = told.revision;
      by('costs').dataset.beside = beside || '';
      command = told.command;
      shown = asked;
      footer();
      say('', 'variant');
      for (const id of ['costs', 'both']) by(id).classList.remove('stale');
    } finally {
      clearTimeout(late);
      by('variant-state').textContent = '';
    }
  });

  by('beside').addEventListener('change', compare);
  document.addEventListener('stands', ({ detail }) => {
    // Another program may have changed the other model while nobody looked.
    if (!stands || stands.pane !== detail.pane) shown = null;
    stands = detail;
    footer();
    compare();
  });
})();
