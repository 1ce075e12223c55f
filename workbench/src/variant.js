// The pane that compares the text with the saved file, or with another model: both mechanisms over each other, the changes, and
// their cost along the recordings.
(() => {
  'use strict';
  const { ask, make, number, percent, cell, asker, say, others, told_command } = window.workbench;
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
  // Four digits are enough for a comparison.
  const short = (v) => (v === null || v === undefined ? '\u2014' : Number(v.toPrecision(4)).toString().replace('-', '\u2212'));
  const signed = (v) => (v < 0 ? `\u2212${percent(-v)}` : `+${percent(v)}`);
  const is_same = (a, b) => a === b || Math.abs(b - a) < 5e-6 * Math.abs(a);
  const noted = (row, words, note, cls) => {
    const box = cell(row, undefined);
    box.append(words);
    if (note) box.append(make('small', note, cls));
    return box;
  };

  // ---- a drive: force, power and work before and after, and the terms of the difference

  const FIGURES = [
    ['peak force', 'peak', true], ['rms force', 'rms', true], ['peak power', 'peak_power', 'W'], ['rms power', 'rms_power', 'W'],
    ['positive work', 'work', 'J'], ['net work', 'net_work', 'J'],
  ];
  const efforts = (one) => table(`${one.drive}`, ['', 'before', 'after', 'change'], FIGURES.map(([words, figure, unit]) => {
    const [before, after] = [one.before[figure], one.after[figure]];
    const row = make('tr');
    cell(row, `${words}, ${unit === true ? one.unit : unit}`);
    cell(row, short(before), 'number');
    cell(row, short(after), 'number');
    const isMore = Math.abs(after) > Math.abs(before);
    if (is_same(before, after)) cell(row, 'none', 'number');
    else cell(row, before ? signed((after - before) / Math.abs(before)) : 'new', `number ${isMore ? 'worse' : 'better'}`);
    return row;
  }));

  const MOST = 6;
  const by_column = (term) => {
    const by_ = term.share - term.by_value;
    if (Math.abs(by_) <= 0.01 * Math.abs(term.share)) return '';
    return term.by_value === 0 ? ', from the changed geometry' : `, ${signed(term.by_value)} from the new value, ${signed(by_)} from the changed geometry`;
  };
  const value = ({ before, after, unit }) => {
    const of = unit === '1' ? '' : ` ${unit}`;
    if (before === null) return `new, ${number(after)}${of}`;
    if (after === null) return `${number(before)}${of}, removed`;
    return before === after ? `${number(after)}${of}` : `${number(before)} \u2192 ${number(after)}${of}`;
  };
  const shares = (one) => {
    const terms = one.products.flatMap((product) => product.terms).sort((a, b) => Math.abs(b.share) - Math.abs(a.share));
    if (!terms.length) return make('p', `No difference at ${one.drive}.`);
    const least = 0.01 * Math.abs(terms[0].share);
    const main = terms.filter((term, i) => i < MOST && Math.abs(term.share) >= least);
    const rows = main.map((term) => {
      const row = make('tr');
      const where = term.term === term.retained ? '' : `in ${term.retained}: `;
      noted(row, make('code', term.term), `${where}${value(term)}${by_column(term)}`);
      cell(row, signed(term.share), 'number');
      return row;
    });
    if (main.length < terms.length) {
      const row = make('tr');
      cell(row, terms.length - main.length === 1 ? 'one other' : `${terms.length - main.length} others`);
      cell(row, signed(terms.slice(main.length).reduce((sum, term) => sum + term.share, 0)), 'number');
      rows.push(row);
    }
    const size = `${short(one.difference.rms)} ${one.unit} rms, ${short(one.difference.peak)} ${one.unit} at most`;
    return table(`What makes the difference, ${size}`, ['summand of p_min', 'share'], rows);
  };

  const drives = (all) => {
    const box = make('div', undefined, 'drives');
    box.append(...all.map((one) => {
      const drive = make('section');
      drive.setAttribute('aria-label', one.drive);
      drive.append(efforts(one), shares(one));
      return drive;
    }));
    return box;
  };

  // ---- both models in total

  // Close to the limit more digits show on which side the value is.
  const part = (used) => {
    if (used === null) return '\u2014';
    return `${Number((100 * used).toPrecision(Math.abs(used - 1) < 0.01 ? 6 : 3))} %`;
  };
  const limits = (all) => {
    const says = { now_exceeded: 'now exceeded', still_exceeded: 'exceeded by both', no_longer_exceeded: 'no longer exceeded', kept: 'not exceeded' };
    const order = Object.keys(says);
    const marks = { now_exceeded: 'worse', no_longer_exceeded: 'better' };
    const rows = [...all].sort((a, b) => order.indexOf(a.crossing) - order.indexOf(b.crossing)).map((one) => {
      const row = make('tr');
      const [before, after] = [one.before, one.after].map(({ range }) => range && range.map(short).join(' to '));
      const ranges = before === after ? before : `${before || 'none'}, then ${after || 'none'}`;
      noted(row, one.limit, [says[one.crossing], ranges].filter(Boolean).join('; '), marks[one.crossing]);
      for (const side of [one.before, one.after]) cell(row, part(side.used), 'number');
      return row;
    });
    return table('Use of the limits', ['limit', 'before', 'after'], rows);
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
    for (const count of [before, after]) cell(row, words(count));
    return row;
  }));

  const entries = (told) => {
    const list = make('table');
    list.append(make('caption', 'Entries that changed'));
    const rows = told.entries.map((one) => {
      const row = make('tr');
      cell(row, one.name);
      cell(row, one.before === null ? 'new' : one.before);
      cell(row, one.after === null ? 'removed' : one.after);
      return row;
    });
    list.createTBody().append(...rows);
    return rows.length ? [list] : [];
  };

  // ---- requests

  others.variant = () => command;
  const footer = () => { if (stands && stands.pane === 'variant') told_command(); };

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
    for (const one of by('both').querySelectorAll('svg')) one.setAttribute('aria-label', 'Both mechanisms; the one before is drawn as a shadow');
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
      if (told.same) pieces.push(make('p', 'Both texts are the same. Edit the text to see what the edit changes.'));
      if (told.refused) pieces.push(make('p', told.refused, 'alias'));
      if (along) {
        for (const note of along.notes) pieces.push(make('p', note.says, note.severity === 'warning' ? 'alias' : ''));
        const seconds = `${short(along.seconds)} s of ${along.recordings.join(', ')}`;
        pieces.push(make('p', `Along ${seconds}:`), drives(along.drives));
        if (along.limits.length) pieces.push(limits(along.limits));
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
    // Another program may have changed the other model while this pane was closed.
    if (!stands || stands.pane !== detail.pane) shown = null;
    stands = detail;
    footer();
    compare();
  });
})();
