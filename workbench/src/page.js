// The workbench: sends the edited text to the program and shows the results. Only one edit is sent at a time; the last text waits,
// so that no more texts are derived than the program can. `window.mill` sends requests to a server or to a worker.
(() => {
  'use strict';
  const { ask, news } = window.mill;
  const by = (id) => document.getElementById(id);
  const text = by('text');
  let view = null, pane = 'mechanism', version = 0;
  let base = 0, sent = null, isSending = false, isTyped = false, opened = null;

  // Shows a sentence above the panes. A caller that updates automatically (`who`) removes only its own sentence.
  const say = (words, who) => {
    const box = by('says');
    if (!words && who && box.dataset.who !== who) return;
    box.dataset.who = who || '';
    box.textContent = words || '';
    box.hidden = !words;
  };

  // Runs work that may fail; shows its error above the panes.
  const tried = async (work, who) => {
    try {
      await work();
      return true;
    } catch (error) {
      say(error.message, who);
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

  const differs_at = (one, other) => {
    let at = 0;
    while (at < one.length && one[at] === other[at]) at++;
    return at;
  };

  // Replaces the text by an edit that the browser can undo; only the part that differs is edited.
  const replace = (words) => {
    const old = text.value, top = text.scrollTop;
    words = plain(words);
    if (old === words) return;
    const from = differs_at(old, words);
    let end = 0;
    while (end < old.length - from && end < words.length - from && old[old.length - 1 - end] === words[words.length - 1 - end]) end++;
    const held = document.activeElement;
    text.focus({ preventScroll: true });
    text.setSelectionRange(from, old.length - end);
    const piece = words.slice(from, words.length - end);
    isTyped = false;
    const isDone = document.execCommand(piece ? 'insertText' : 'delete', false, piece);
    if (!isDone || text.value !== words) text.value = words;
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
  // Sends the current text, and again if it was changed meanwhile.
  const send = async () => {
    if (isSending || !view) return;
    isSending = true;
    while (sent !== text.value) {
      const words = text.value;
      const late = setTimeout(() => slow(true), 1500);
      try {
        const told = await ask('edit', { base, text: words });
        sent = words;
        base = told.revision;
        show(told);
      } catch (error) {
        if (error.status === 409) {
          // Another window sent a text first: it is loaded, unless this window has typed text that was not sent.
          const told = await news(0).catch(() => null);
          if (!told) { say(error.message); break; }
          if (isTyped) {
            base = told.revision;
            say('The text was changed in another window while you typed. This window keeps your text.');
          } else follow(told);
          continue;
        }
        say(error.message);
        break;
      } finally {
        clearTimeout(late);
        slow(false);
      }
    }
    isTyped = false;
    isSending = false;
  };

  const follow = (told) => {
    base = told.revision;
    replace(told.text);
    sent = text.value;
    isTyped = false;
    show(told);
  };

  // ---- the view

  const show = (told) => {
    if (told.version < version) return;
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
    by('diagnose').disabled = !view.data;
    for (const id of ['places', 'draw']) by(id).disabled = !view.data;
    for (const id of ['curves', 'where', 'written', 'found']) { by(id).replaceChildren(); mark_stale(id); }
    by('motion').hidden = true;
    if (view.data) load(); else by('errors').textContent = window.mill.hint;
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
    const svg = await ask('picture', {
      at: Object.entries(at), from, names: by('names').checked, frames: by('frames').checked, shadow: by('shadow').checked, loads,
    });
    by('picture').innerHTML = svg;
    looked.again();
    by('picture').dataset.drawn = Number(by('picture').dataset.drawn || 0) + 1;
    say('', 'picture');
  });

  const compare = asker('errors', async () => {
    if (!view || !view.valid || !view.data) return;
    if (errors && errors.revision === view.revision) return;
    compared(await ask('compare', { places: false, afresh: false }));
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
    by('comparison').dataset.revision = told.revision;
    stepErrors();
    say('', 'errors');
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
    errors_of_now();
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

  const sliders = () => {
    const { coordinates } = view.model;
    const names = coordinates.map((one) => one.name).join();
    if (by('coordinates').dataset.names === names) return;
    by('coordinates').dataset.names = names;
    for (const name in at) delete at[name];
    by('coordinates').replaceChildren(...coordinates.map((one) => {
      const label = make('label', one.name);
      const input = make('input');
      const reach = one.angle ? Math.PI : Math.max(0.5, Math.abs(one.nominal));
      Object.assign(input, { type: 'range', min: one.nominal - reach, max: one.nominal + reach, step: 'any', value: one.nominal });
      input.dataset.name = one.name;
      const told = make('output', number(one.nominal));
      input.addEventListener('input', () => { at[one.name] = Number(input.value); told.textContent = number(at[one.name]); draw(); });
      label.append(input, told);
      return label;
    }));
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
  const largest = (all) => Math.max(...all.map((one) => one.reduce((most, v) => Math.max(most, Math.abs(v)), 0)), 1e-300);
  // An error of this share of the largest force has the full colour.
  const FAR_OFF = 0.2;
  // Forces at a time as shares of the largest of the run, and errors as shares of the error with full colour.
  const shares = (run, time) => {
    if (!run.forces || !by('forces').checked) return [];
    run.largest = run.largest || largest(run.forces.measured);
    const k = place(run.forces.time, time);
    return motion.drives.map((drive, d) => [drive, (run.forces.measured[d][k] || 0) / run.largest, Math.min(1, Math.abs(run.forces.error[d][k] || 0) / (FAR_OFF * run.largest))]);
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
    draw();
  };
  const choose = () => {
    const run = chosen();
    by('time').max = run.time.length - 1;
    by('time').value = 0;
    by('with-forces').hidden = !run.forces;
  };
  const offer = () => {
    const runs = [...(recorded ? recorded.runs : []), ...(planned ? planned.runs : [])];
    motion = runs.length ? { names: (recorded || planned).names, drives: recorded ? recorded.drives : [], runs } : null;
    by('motion').hidden = !motion;
    by('run').replaceChildren(...runs.map((run) => make('option', run.file)));
    if (motion) choose();
  };
  let shown_of = null, waiting = null;
  const load = () => tried(async () => {
    shown_of = view.derived;
    recorded = await ask('motion', {});
    offer();
  });
  // Errors are updated to the current text when typing stops.
  const errors_of_now = () => {
    if (!recorded || shown_of === view.derived || pane !== 'mechanism' || !by('forces').checked) return;
    clearTimeout(waiting);
    waiting = setTimeout(() => tried(async () => {
      const of = view.derived;
      const told = await ask('motion', {});
      shown_of = of;
      told.runs.forEach((run, i) => { if (recorded.runs[i]) recorded.runs[i].forces = run.forces; });
      if (motion && !playing) pose(Number(by('time').value));
    }), 400);
  };
  by('forces').addEventListener('change', () => pose(Number(by('time').value)));
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

  // ---- diagnosis

  let shown = -1;
  const findings = (told) => {
    const box = by('found');
    box.replaceChildren();
    listed(box, told);
    made_of('found', told.of_this_text ? String(view.revision) : '');
  };
  const listed = (box, told) => {
    if (told.cancelled) box.append(make('p', 'The diagnosis was cancelled.'));
    if (told.failed) box.append(make('p', told.failed, 'alias'));
    const { found } = told;
    if (!found) return;
    const verdict = { adequate: ' adequate', unexplained: ' unexplained' }[found.verdict] || '';
    box.append(make('p', found.says, `verdict${verdict}`));
    found.entries.forEach((entry, k) => {
      const one = make('div', undefined, 'finding');
      one.append(make('b', `${entry.kind.replaceAll('_', ' ')} (${entry.at.join(', ')}) `));
      const values = [...Object.entries(entry.parameters).map(([name, p]) => [name, p.nominal]), ...Object.entries(entry.constants)];
      one.append(make('span', values.filter(([, v]) => v !== null).map(([name, v]) => `${name} = ${number(v)}`).join(', ')), ' ');
      const button = make('button', 'Add');
      button.type = 'button';
      button.addEventListener('click', () => tried(async () => {
        button.disabled = true;
        try {
          const before = text.value;
          // The new text may arrive by a notification before the response does.
          follow(await ask('add', { entry: k }));
          say('');
          go(line_of(differs_at(before, text.value)));
        } catch (error) { button.disabled = false; throw error; }
      }));
      one.append(button, make('br'), make('code', entry.command));
      box.append(one);
    });
    for (const effect of found.effects) {
      if (!effect.indistinguishable_from.length) continue;
      const others = effect.indistinguishable_from.map((o) => `${o.kind.replaceAll('_', ' ')} (${o.at.join(', ')})`).join(', ');
      box.append(make('p', `These recordings cannot distinguish ${effect.kind.replaceAll('_', ' ')} from ${others}. ${effect.separate_by || ''}`));
      if (effect.separate_command) box.append(make('code', effect.separate_command));
    }
    for (const one of found.corrected) box.append(make('p', `${one.heading}: ${one.todo}.`));
    for (const one of found.disturbances.filter((one) => !one.in_verdict)) box.append(make('p', `Disturbance in the recordings: ${one.says}.`));
    const figure = make('figure', undefined, 'still');
    figure.innerHTML = found.picture;
    figure.prepend(make('figcaption', `Error relative to the force ${found.judged}`));
    box.append(figure);
    window.enlivenPictures(box);
    const list = make('ul');
    for (const one of found.where) list.append(make('li', `${one.says}.`));
    box.append(list);
    for (const note of found.data) if (note.severity === 'warning') box.append(make('p', note.says, 'alias'));
  };
  const follow_diagnosis = async () => {
    for (;;) {
      const told = await ask('diagnosis', {});
      const { going } = told;
      by('diagnose').disabled = Boolean(going) || !view.data;
      by('cancel').hidden = by('progress').hidden = !going;
      if (!going) {
        by('going').textContent = '';
        if (told.number > 0 && shown !== told.number) { shown = told.number; findings(told); }
        return;
      }
      by('going').textContent = `${going.what}, ${going.seconds.toFixed(0)} s`;
      if (going.total) Object.assign(by('progress'), { max: going.total, value: going.done });
      else by('progress').removeAttribute('value');
      await new Promise((done) => setTimeout(done, 200));
    }
  };
  by('diagnose').addEventListener('click', () => tried(async () => {
    await send();
    by('found').replaceChildren();
    mark_stale('found');
    await ask('diagnose', {});
    say('');
    await follow_diagnosis();
  }));
  by('cancel').addEventListener('click', () => tried(() => ask('cancel', {})));

  // ---- the rest

  const save = () => tried(async () => { await send(); show(await ask('save', {})); say(''); });
  by('save').addEventListener('click', save);
  document.addEventListener('keydown', (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key === 's') { event.preventDefault(); save(); }
  });
  by('theirs').addEventListener('click', () => tried(async () => follow(await ask('choose', { theirs: true }))));
  by('mine').addEventListener('click', () => tried(async () => show(await ask('choose', { theirs: false }))));
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
  text.addEventListener('input', () => { lines(); isTyped = true; send(); });
  text.addEventListener('scroll', () => { by('lines').scrollTop = text.scrollTop; });
  window.addEventListener('beforeunload', (event) => { if (view && (view.changed || sent !== text.value)) event.preventDefault(); });

  // Functions for the scripts of single panes.
  window.workbench = {
    ask, make, number, percent, cell, amount, asker, say, tried, others, send, told_command,
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
        if (told.version <= version || isSending) {
          // The response that is awaited has the new view; until then the request is repeated.
          if (isSending) await new Promise((done) => setTimeout(done, 50));
          continue;
        }
        if (told.revision !== base) follow(told); else show(told);
        follow_diagnosis().catch(() => {});
      } catch (error) {
        by('state').textContent = `the program does not answer (${error.message}). Keep this page open: it still has your text`;
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
    watch();
    await follow_diagnosis();
  });
})();
