// The workbench: sends the edited text to the program and shows the results. Only one edit is sent at a time; the last text waits,
// so that no more texts are derived than the program can. `window.mill` sends requests to a server or to a worker.
(() => {
  'use strict';
  const { ask, news } = window.mill;
  const by = (id) => document.getElementById(id);
  const text = by('text');
  let view = null, pane = 'mechanism', version = 0;
  // `sent` is the last text of the server that this window knows, `base` its revision.
  let base = 0, sent = null, opened = null;

  // Shows a sentence above the panes. A caller that updates automatically (`who`) removes only its own sentence.
  const say = (words, who) => {
    const box = by('says');
    if (!words && who && box.dataset.who !== who) return;
    box.dataset.who = who || '';
    box.textContent = words || '';
    box.hidden = !words;
  };

  // Downloads the text, for a program that cannot save it any more.
  const rescue = () => {
    const link = make('a');
    link.href = URL.createObjectURL(new Blob([text.value], { type: 'application/toml' }));
    link.download = view ? view.file.split(/[\\/]/).pop() : 'model.toml';
    link.click();
    // Some browsers start the download later.
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  };
  // Shows an error. If the program did not answer, the sentence disappears once it answers again.
  const say_error = (error, who) => {
    say(error.message, error.isUnanswered ? 'connection' : who);
    if (!error.isUnanswered) return;
    const button = make('button', 'Download the text');
    button.type = 'button';
    button.addEventListener('click', rescue);
    by('says').append(' ', button);
  };

  // Runs work that may fail; shows its error above the panes. Work that is repeated automatically (`who`) removes its sentence
  // once it succeeds.
  const tried = async (work, who) => {
    try {
      await work();
      if (who) say('', who);
      return true;
    } catch (error) {
      say_error(error, who);
      return false;
    }
  };

  const make = (name, words, cls) => {
    const element = document.createElement(name);
    if (words !== undefined) element.textContent = words;
    if (cls) element.className = cls;
    return element;
  };
  const number = (v) => (v === null || v === undefined ? '\u2014' : Number(v.toPrecision(6)).toString().replace('-', '\u2212'));
  const percent = (v) => (v === null || v === undefined ? '\u2014' : `${Number((100 * v).toPrecision(3))} %`);
  const cell = (row, words, cls) => row.appendChild(make('td', words, cls));
  // A number in a table; a click copies all of its digits.
  const amount = (row, words, value) => {
    const one = cell(row, words, 'number');
    if (value !== null && value !== undefined) one.dataset.value = value;
  };
  const put = (element, html) => { element.innerHTML = html; window.enliven(element); };

  // ---- the text

  const plain = (words) => words.replace(/\r\n/g, '\n');

  // Replaces the text by an edit that the browser can undo; only the part that differs is edited.
  const replace = (words) => {
    const old = text.value, top = text.scrollTop;
    words = plain(words);
    if (old === words) return;
    const { from, to, put } = window.texts.edit_between(old, words);
    const held = document.activeElement;
    // The caret stays at its letter.
    const moved = (at) => (at <= from ? at : at >= to ? at + put.length - (to - from) : from + put.length);
    const caret = [text.selectionStart, text.selectionEnd].map(moved);
    text.focus({ preventScroll: true });
    text.setSelectionRange(from, to);
    const isDone = document.execCommand(put ? 'insertText' : 'delete', false, put);
    if (!isDone || text.value !== words) text.value = words;
    text.setSelectionRange(...caret);
    if (held && held !== text) held.focus({ preventScroll: true });
    text.scrollTop = top;
    lines();
  };

  const lines = () => {
    const count = text.value.split('\n').length;
    const gutter = by('lines');
    while (gutter.childElementCount > count) gutter.lastElementChild.remove();
    while (gutter.childElementCount < count) gutter.appendChild(make('div', String(gutter.childElementCount + 1)));
    gutter.scrollTop = text.scrollTop;
  };

  // The first nonempty line of a text that was inserted at an offset.
  const line_of = (start) => {
    const ahead = text.value.slice(start).search(/\S/);
    return text.value.slice(0, start + Math.max(ahead, 0)).split('\n').length;
  };

  const go = (line, column) => {
    const all = text.value.split('\n');
    const start = all.slice(0, line - 1).reduce((n, one) => n + one.length + 1, 0);
    text.focus();
    text.setSelectionRange(start + (column || 1) - 1, start + (all[line - 1] || '').length);
    const height = text.scrollHeight / all.length;
    text.scrollTop = Math.max(0, (line - 6) * height);
  };

  const faults = () => {
    const list = by('faults'), gutter = by('lines');
    for (const one of gutter.children) { one.className = ''; one.title = ''; }
    const notes = (view.notes || []).filter((note) => note.severity === 'warning');
    list.replaceChildren(...[...view.diagnostics, ...notes].map((fault) => {
      const item = make('li', undefined, fault.severity);
      const isHere = !fault.file || fault.file === view.file;
      const place = fault.line ? `${isHere ? 'line' : `${fault.file}, line`} ${fault.line}: ` : '';
      const more = [fault.expected, fault.help].filter(Boolean).join('; ');
      const words = `${place}${fault.says}${more ? ` (${more})` : ''}`;
      const button = item.appendChild(make('button', words));
      button.type = 'button';
      if (fault.line && isHere) {
        button.addEventListener('click', () => go(fault.line, fault.column));
        const mark = gutter.children[fault.line - 1];
        if (mark && mark.className !== 'error') { mark.className = fault.severity; mark.title = words; }
      }
      return item;
    }));
  };

  const slow = window.mill.slow || (() => {});
  // Sends the current text, and again if it was changed meanwhile. Who waits for it waits for a send that is under way as well.
  let sending = null;
  const send = () => {
    if (view && !sending) sending = deliver().finally(() => { sending = null; });
    return sending || Promise.resolve();
  };
  const deliver = async () => {
    while (sent !== text.value) {
      const words = text.value;
      const late = setTimeout(() => slow(true), 1500);
      try {
        const told = await ask('edit', { base, text: words });
        // The view may have an edit of another window already, which came after this one.
        follow(told, words);
      } catch (error) {
        if (error.status !== 409) { say_error(error); break; }
        // Another window sent a text first.
        const told = await news(0).catch(() => null);
        if (!told) { say_error(error); break; }
        follow(told);
      } finally {
        clearTimeout(late);
        slow(false);
      }
    }
  };

  // Shows a view and its text. Edits of this window that were not sent are kept, unless another window edited the same line.
  const follow = (told, words = sent) => {
    if (told.version < version || told.revision < base) return;
    const theirs = plain(told.text);
    sent = words;
    // Edits of one model are not edits of another one.
    const merged = told.opened === opened ? window.texts.merge(sent, text.value, theirs) : theirs;
    [base, sent] = [told.revision, theirs];
    replace(merged === null ? theirs : merged);
    show(told);
    if (merged === null) say('Another window changed the line in which you typed. Its text is shown and yours is not in it. Undo (Ctrl+Z) brings yours back.');
    if (sent !== text.value) send();
  };
  // The same for the response to a button; an edit that is under way comes first.
  const take = async (told) => {
    await sending;
    follow(told);
  };

  // ---- the view

  const show = (told) => {
    if (told.version < version) return;
    // The list of faults explains why work on the text failed.
    if (!told.valid && by('says').dataset.who && by('says').dataset.who !== 'connection') say('');
    version = told.version;
    view = told;
    document.title = `${view.changed ? '\u2022 ' : ''}${view.file}`;
    by('file').textContent = view.file;
    by('state').textContent = [
      view.unreadable ? `the file cannot be read: ${view.unreadable}` : view.changed ? 'not saved' : 'saved',
      view.valid ? `derived in ${(1000 * view.seconds).toFixed(0)} ms` : 'not derived',
    ].join(', ');
    by('save').disabled = !view.changed;
    by('banner').hidden = !view.conflict;
    by('banner').firstElementChild.textContent =
      'Another program changed the file, and this text has unsaved changes. Nothing is written until you choose one of the two texts.';
    lines();
    faults();
    for (const one of document.querySelectorAll('.pane')) one.classList.toggle('stale', !view.valid);
    if (view.model) { equations(); sliders(); by('equations').dataset.revision = view.derived; }
    stepErrors();
    for (const hear of window.workbench.heard) hear(view);
    if (opened !== view.opened) { opened = view.opened; brought(); }
    told_command();
    if (view.valid && view.derived === view.revision) refresh();
  };

  // Commands of panes that have a separate script.
  const others = {};
  const command = () => {
    const { commands } = view;
    const step = { mechanism: 'picture', equations: 'equations', comparison: 'compare', diagnosis: 'diagnose', steps: 'identify' };
    if (pane === 'comparison' && by('identified').checked) return commands.identify;
    return pane in others ? others[pane](commands) : commands[step[pane]];
  };
  const told_command = () => {
    const words = command();
    by('command').textContent = words || '';
    by('command').parentElement.hidden = !words;
  };
  // Another model or other recordings were opened.
  const brought = () => {
    say('');
    errors = motion = recorded = planned = null;
    loads = [];
    by('load-key').hidden = true;
    by('diagnose').disabled = !view.data;
    // There is nothing to search or draw before the first comparison.
    for (const id of ['places', 'draw']) by(id).disabled = true;
    for (const id of ['curves', 'where', 'written', 'found']) { by(id).replaceChildren(); mark_stale(id); }
    by('motion').hidden = true;
    by('errors').textContent = !view.data ? window.mill.hint
      : view.valid ? 'Reading and comparing the recordings\u2026' : 'The recordings are compared once the text has no faults.';
  };

  const equations = () => {
    const { model } = view;
    by('made').textContent =
      `${model.products} products of parameters with an effect on the drives, ${model.base.length} base parameters (combinations that can be identified); derived in ${(1000 * view.seconds).toFixed(0)} ms.`;
    by('base').tBodies[0].replaceChildren(...model.base.map((one) => {
      const row = make('tr', undefined, one.change);
      cell(row, one.name);
      row.appendChild(make('td')).appendChild(make('code', one.expression));
      amount(row, number(one.value), one.value);
      cell(row, one.unit === '1' ? '' : one.unit);
      if (one.change === 'changed') amount(row, number(one.was), one.was); else cell(row, '', 'number');
      return row;
    }));
    window.enlivenTables(by('base'));
    by('gone').textContent = model.gone.join('; ');
    by('summary').textContent = model.summary;
  };

  const stepErrors = () => {
    const row = (what, errors) => {
      const one = make('tr');
      cell(one, what);
      for (const whose of ['nominal', 'identified'])
        for (const of of ['fit', 'check']) amount(one, percent(errors[whose][of]), errors[whose][of]);
      return one;
    };
    const rows = view.session_steps.map((one) => row(one.what, one.errors));
    if (errors && errors.revision === view.revision) {
      const brief = (f) => ({ fit: f.fit && f.fit.nrms, check: f.check && f.check.nrms });
      rows.push(row('current text', { nominal: brief(errors.nominal), identified: brief(errors.identified) }));
    }
    by('step-errors').tBodies[0].replaceChildren(...rows);
    window.enlivenTables(by('step-errors'));
  };

  // ---- panes that send requests

  // Only one request of a kind is sent at a time; the last one waits.
  const asker = (who, work) => {
    let isGoing = false, isWanted = false;
    return async () => {
      isWanted = true;
      if (isGoing) return;
      isGoing = true;
      while (isWanted) {
        isWanted = false;
        await tried(work, who);
      }
      isGoing = false;
    };
  };

  let errors = null, from = null, loads = [];
  const at = {};

  const draw = asker('picture', async () => {
    if (pane !== 'mechanism' || !view || !view.valid) return;
    // A picture of another pose must not look like the one of the requested pose.
    const svg = await ask('picture', {
      at: Object.entries(at), from, names: by('names').checked, frames: by('frames').checked, shadow: by('shadow').checked, loads,
    }).catch((error) => {
      by('picture').classList.add('stale');
      if (error.status === 422) error.message += '. The picture still shows the last pose that could be drawn.';
      throw error;
    });
    by('picture').classList.remove('stale');
    by('picture').innerHTML = svg;
    looked.again();
    by('picture').dataset.drawn = Number(by('picture').dataset.drawn || 0) + 1;
  });

  const compare = asker('errors', async () => {
    if (!view || !view.valid || !view.data) return;
    if (errors && errors.revision === view.revision) return;
    if (!errors) by('errors').textContent = 'Reading and comparing the recordings\u2026';
    compared(await ask('compare', { places: false, afresh: false }).catch((error) => {
      if (!errors) by('errors').textContent = 'The recordings cannot be compared; the reason is above.';
      throw error;
    }));
    // Remarks on the recordings may depend on values: they are updated when typing stops.
    clearTimeout(rest);
    if (!errors.afresh) rest = setTimeout(again, 700);
  });
  let rest = 0;
  const again = () => tried(async () => {
    const { revision } = view;
    const told = await ask('compare', { places: false, afresh: true });
    if (told.revision === revision && revision === view.revision) compared(told);
  }, 'errors');
  const compared = (told) => {
    errors = told;
    const notes = told.notes.filter((note) => note.severity === 'warning').map((note) => make('p', note.says, 'alias'));
    by('errors').replaceChildren(figures(told), ...notes);
    for (const id of ['places', 'draw']) by(id).disabled = false;
    by('comparison').dataset.revision = told.revision;
    stepErrors();
  };

  // Results of a button stay until the button is used again; a note says that the text has changed since.
  const mark_stale = (id) => {
    const one = by(id);
    const isOld = one.childElementCount > 0 && one.dataset.revision !== String(view.revision);
    one.classList.toggle('stale', isOld);
    const told = one.previousElementSibling;
    const isTold = told.classList.contains('of-before');
    if (isOld && !isTold) one.before(make('p', 'This result is of an earlier text. Use the button again for the current text.', 'alias of-before'));
    if (!isOld && isTold) told.remove();
  };
  const made_of = (id, revision) => { by(id).dataset.revision = revision; mark_stale(id); };
  const refresh = () => {
    draw();
    compare();
    clearTimeout(waiting);
    if (!recorded) load(); else if (pane === 'mechanism' && by('forces').checked) waiting = setTimeout(load, 400);
    document.dispatchEvent(new CustomEvent('stands', { detail: { view, pane, seen: { at: Object.entries(at), from } } }));
    for (const old of ['curves', 'where', 'written', 'found']) mark_stale(old);
  };

  const figures = (told) => {
    const table = make('table');
    const head = table.createTHead().insertRow();
    for (const words of ['error relative to the force', 'fit', 'validation', 'identified, fit', 'identified, validation'])
      head.appendChild(make('th', words, words.startsWith('error') ? '' : 'number')).scope = 'col';
    const all = [told.nominal.fit, told.nominal.check, told.identified.fit, told.identified.check];
    const body = table.createTBody();
    const row = (name, value) => {
      const one = body.insertRow();
      cell(one, name);
      for (const figures of all) amount(one, figures ? percent(value(figures)) : '\u2014', figures && value(figures));
    };
    row('all drives', (f) => f.nrms);
    for (const drive of Object.keys(told.nominal.fit.channels)) row(drive, (f) => f.channels[drive].nrms);
    window.enlivenTables(table);
    return table;
  };

  // The range of a slider: the limits of the model file if it has any; it always contains the nominal value.
  const range = ({ angle, nominal, limits }) => {
    const reach = angle ? Math.PI : Math.max(0.5, Math.abs(nominal));
    const [low, high] = limits || [nominal - reach, nominal + reach];
    return { min: Math.min(low, nominal), max: Math.max(high, nominal) };
  };
  const sliders = () => {
    const { coordinates } = view.model;
    const names = coordinates.map((one) => one.name);
    // A pose that was set stays for all coordinates that the edited text still has.
    for (const name in at) if (!names.includes(name)) delete at[name];
    if (by('coordinates').dataset.names !== names.join()) {
      by('coordinates').dataset.names = names.join();
      by('coordinates').replaceChildren(...names.map((name) => {
        const label = make('label', name);
        const input = make('input');
        Object.assign(input, { type: 'range', step: 'any' });
        input.dataset.name = name;
        const told = make('output');
        input.addEventListener('input', () => {
          at[name] = Number(input.value);
          told.textContent = number(at[name]);
          // Forces belong to a moment of the recording, not to this pose.
          loads = [];
          by('load-key').hidden = true;
          draw();
        });
        label.append(input, told);
        return label;
      }));
    }
    coordinates.forEach((one, i) => {
      const [input, told] = by('coordinates').children[i].children;
      const value = one.name in at ? at[one.name] : one.nominal;
      Object.assign(input, range(one), { value });
      told.textContent = number(value);
    });
  };

  const turn = (azimuth, elevation) => {
    const wrapped = ((azimuth + 180) % 360 + 360) % 360 - 180;
    from = [wrapped, Math.max(-90, Math.min(90, elevation))];
    [by('azimuth').value, by('elevation').value] = from;
    draw();
  };
  const angles = () => [Number(by('azimuth').value), Number(by('elevation').value)];
  for (const id of ['azimuth', 'elevation']) by(id).addEventListener('input', () => turn(...angles()));
  by('flat').addEventListener('click', () => { from = null; draw(); });
  for (const id of ['names', 'frames', 'shadow']) by(id).addEventListener('change', draw);
  // Dragging rotates the view; zooming is the same as for every picture.
  const looked = {
    ...window.seen(() => by('picture').querySelector('svg')),
    turn: (dx, dy) => turn(angles()[0] + 200 * dx, angles()[1] - 200 * dy),
    step: 0.05,
  };
  window.zoomable(by('picture'), looked, by('view'));

  // ---- along a recording

  // Recordings, and a planned trajectory.
  let motion = null, recorded = null, planned = null, playing = null;
  const chosen = () => motion.runs[by('run').selectedIndex];
  // Index of the last element of an increasing list that is not larger than a value.
  const place = (all, value) => {
    let [low, high] = [0, all.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (all[middle] <= value) low = middle; else high = middle - 1;
    }
    return low;
  };
  // The largest measured force of a run for each unit. Forces and torques have no common scale.
  const scales = (run) => {
    run.scales = run.scales || motion.units.reduce((all, unit, d) => {
      all[unit] = run.forces.measured[d].reduce((most, v) => Math.max(most, Math.abs(v)), all[unit] || 0);
      return all;
    }, {});
    return run.scales;
  };
  // Forces and errors at a time, as shares of the largest force with the same unit.
  const shares = (run, time) => {
    if (!run.forces || !by('forces').checked) return [];
    const k = place(run.forces.time, time);
    return motion.drives.map((drive, d) => {
      const full = scales(run)[motion.units[d]] || 1e-300;
      return [drive, (run.forces.measured[d][k] || 0) / full, Math.abs(run.forces.error[d][k] || 0) / full];
    });
  };
  // The scale of the arrows, and the meaning of their colours.
  const load_key = (run) => {
    by('load-key').hidden = !loads.length;
    if (!loads.length) return;
    const full = Object.entries(scales(run)).map(([unit, most]) => `${number(Number(most.toPrecision(4)))} ${unit}`).join(' or ');
    const bounds = motion.shades.map((share) => `${100 * share} %`);
    const words = [`below ${bounds[0]}`, ...bounds.slice(1).map((bound, i) => `${bounds[i]} to ${bound}`), `above ${bounds[bounds.length - 1]}`];
    by('load-key').replaceChildren(`The longest arrow is ${full}, the largest measured force of this recording. Error of the model relative to it: `,
      ...words.map((one, i) => { const key = make('span', one, `e${i}`); key.prepend(make('i')); return key; }));
  };
  const pose = (k) => {
    const run = chosen();
    motion.names.forEach((name, i) => {
      at[name] = run.q[i][k];
      const input = by('coordinates').querySelector(`input[data-name="${CSS.escape(name)}"]`);
      if (input) { input.value = at[name]; input.nextElementSibling.textContent = number(at[name]); }
    });
    by('moment').textContent = `${run.time[k].toFixed(2)} s`;
    loads = shares(run, run.time[k]);
    load_key(run);
    draw();
  };
  const choose = () => {
    const run = chosen();
    by('time').max = run.time.length - 1;
    by('time').value = 0;
    by('with-forces').hidden = !run.forces;
  };
  // Lists recordings and planned motion; the selected run and its time stay selected.
  const offer = () => {
    const runs = [...(recorded ? recorded.runs : []), ...(planned ? planned.runs : [])];
    const { names, drives, units, shades } = recorded || { drives: [], units: [], ...planned };
    const [was, when] = [motion && by('run').selectedIndex, by('time').value];
    motion = runs.length ? { names, drives, units, shades, runs } : null;
    by('motion').hidden = !motion;
    by('run').replaceChildren(...runs.map((run) => make('option', run.file)));
    if (!motion) return;
    if (was > 0 && was < runs.length) by('run').selectedIndex = was;
    choose();
    by('time').value = when;
  };
  // Reads the motion of the recordings, then again for the errors of a changed text.
  let shown_of = null, waiting = null;
  const load = asker('motion', async () => {
    if (!view || !view.valid || !view.data || view.derived !== view.revision || (recorded && shown_of === view.derived)) return;
    const { derived, opened: whose } = view;
    const told = await ask('motion', {});
    if (whose !== view.opened) return;
    shown_of = derived;
    recorded = told;
    offer();
    // Only a picture that follows the recording has arrows.
    if (loads.length && !playing) pose(Number(by('time').value));
  });
  // Arrows need a moment of the recording; without them the pose stays.
  by('forces').addEventListener('change', () => {
    if (by('forces').checked) { pose(Number(by('time').value)); load(); return; }
    loads = [];
    by('load-key').hidden = true;
    draw();
  });
  by('run').addEventListener('change', () => { choose(); pose(0); });
  by('time').addEventListener('input', () => pose(Number(by('time').value)));
  by('play').addEventListener('click', () => {
    by('play').textContent = playing ? 'Play' : 'Stop';
    if (playing) { clearInterval(playing); playing = null; return; }
    const run = chosen();
    const start = performance.now() - 1000 * (run.time[Number(by('time').value)] - run.time[0]);
    playing = setInterval(() => {
      const span = run.time[run.time.length - 1] - run.time[0];
      const t = run.time[0] + ((performance.now() - start) / 1000) % Math.max(span, 0.1);
      const k = place(run.time, t);
      by('time').value = k;
      pose(k);
    }, 33);
  });

  // ---- written out, curves, places

  by('write').addEventListener('click', () => tried(async () => {
    by('written').textContent = 'writing\u2026';
    const { revision } = view;
    const page = new DOMParser().parseFromString(await ask('equations', {}), 'text/html');
    for (const one of page.querySelectorAll('nav, h1, figure.picture, script')) one.remove();
    by('written').replaceChildren(...page.querySelector('main').childNodes);
    window.enliven(by('written'));
    window.enlivenTables(by('written'));
    made_of('written', revision);
  }).then((isDone) => { if (!isDone) by('written').textContent = ''; }));
  by('draw').addEventListener('click', () => tried(async () => {
    by('curves').textContent = 'comparing\u2026';
    const { revision } = view;
    const html = await ask('curves', { identified: by('identified').checked });
    put(by('curves'), html);
    made_of('curves', revision);
    say('');
  }).then((isDone) => { if (!isDone) by('curves').textContent = ''; }));
  by('identified').addEventListener('change', told_command);
  by('places').addEventListener('click', () => tried(async () => {
    const told = await ask('compare', { places: true, afresh: true });
    const { where, by_rate } = told.compared;
    const places = where.length ? where : [{ says: 'No region of coordinates, rates, loads or time has a larger error than the rest' }];
    by('where').replaceChildren(...[...places, ...by_rate].map((one) => make('li', `${one.says}.`)));
    made_of('where', told.revision);
    say('');
  }));

  // ---- the rest

  // Only the text that this window shows is saved.
  const save = () => tried(async () => {
    await send();
    if (sent !== text.value) return;
    try {
      await take(await ask('save', { base }));
      say('');
    } catch (error) {
      if (error.status !== 409) throw error;
      await take(await news(0));
      throw new Error('Nothing is saved, because another window changed the text at this moment. The text with both edits is shown. Save again.');
    }
  });
  by('save').addEventListener('click', save);
  document.addEventListener('keydown', (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key === 's') { event.preventDefault(); save(); }
  });
  by('theirs').addEventListener('click', () => tried(async () => take(await ask('choose', { theirs: true }))));
  by('mine').addEventListener('click', () => tried(async () => take(await ask('choose', { theirs: false }))));
  by('copy').addEventListener('click', () => window.copied(by('command').textContent, 'the command'));
  const open = (name) => {
    // A message of one pane is not for another one.
    if (pane !== name) say('');
    pane = name;
    for (const one of document.querySelectorAll('.pane')) one.hidden = one.id !== pane;
    for (const tab of by('tabs').children) tab.setAttribute('aria-selected', String(tab.dataset.pane === pane));
    if (view) { told_command(); refresh(); }
    document.dispatchEvent(new CustomEvent('pane', { detail: pane }));
  };
  for (const tab of by('tabs').children) tab.addEventListener('click', () => open(tab.dataset.pane));
  by('tabs').addEventListener('keydown', (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const tabs = [...by('tabs').children];
    const next = tabs[(tabs.indexOf(document.activeElement) + step + tabs.length) % tabs.length];
    next.focus();
    open(next.dataset.pane);
  });
  text.addEventListener('input', () => { lines(); send(); });
  text.addEventListener('scroll', () => { by('lines').scrollTop = text.scrollTop; });
  window.addEventListener('beforeunload', (event) => { if (view && (view.changed || sent !== text.value)) event.preventDefault(); });

  // Functions for the scripts of single panes.
  window.workbench = {
    ask, make, number, percent, cell, amount, asker, say, tried, others, send, told_command, take, go, line_of, mark_stale, made_of,
    view: () => view,
    // Adds a trajectory along which the mechanism can be moved; `true` plays it.
    animate: (names, run, isShown) => {
      planned = { names, runs: [run] };
      offer();
      if (!isShown) return;
      open('mechanism');
      by('run').selectedIndex = motion.runs.length - 1;
      choose();
      if (!playing) by('play').click();
    },
    heard: [],
  };

  const watch = async () => {
    for (;;) {
      try {
        const told = await news(version);
        say('', 'connection');
        if (told.version <= version || sending) {
          // The response that is awaited has the new view; until then the request is repeated.
          if (sending) await new Promise((done) => setTimeout(done, 50));
          continue;
        }
        follow(told);
      } catch (error) {
        by('state').textContent = error.message;
        await new Promise((done) => setTimeout(done, 2000));
      }
    }
  };
  tried(async () => {
    const told = await news(0);
    text.value = plain(told.text);
    sent = text.value;
    base = told.revision;
    show(told);
    text.focus();
    text.setSelectionRange(0, 0);
    text.scrollTop = 0;
    lines();
    if (told.beside) open('variant');
    watch();
  });
})();
