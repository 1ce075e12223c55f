// The pane that plans a motion: its limits, a search with its progress, its picture, and the file.
(() => {
  'use strict';
  const { ask, make, number, cell, amount, say, tried, others, send, told_command, view, animate, heard } = window.workbench;
  const by = (id) => document.getElementById(id);
  const FIELDS = ['harmonics', 'period', 'random', 'starts', 'seed', 'rate'];
  const KINDS = [['position', ''], ['rate', '_d'], ['acceleration', '_dd']];
  let shown = -1, command = null, derived = -1, isOpen = false;

  others.excitation = (commands) => command || commands.excite;

  // ---- limits

  const field = (row, words, value, isNeeded) => {
    const input = make('input');
    Object.assign(input, { type: 'text', inputMode: 'decimal', value: value === undefined ? '' : String(value) });
    input.setAttribute('aria-label', words);
    input.dataset.was = input.value;
    if (isNeeded) input.setAttribute('aria-invalid', 'true');
    input.addEventListener('input', () => {
      input.toggleAttribute('aria-invalid', false);
      if (!Number.isFinite(Number(input.value)) || (isNeeded && input.value.trim() === '')) input.setAttribute('aria-invalid', 'true');
    });
    row.insertCell().append(input);
  };
  // Typed values stay as long as the coordinates are the same.
  const limits = () => tried(async () => {
    if (!isOpen || !view() || !view().valid || derived === view().derived) return;
    derived = view().derived;
    const rows = await ask('limits', {});
    const typed = new Map([...by('limits').querySelectorAll('input')].filter((one) => one.value !== one.dataset.was).map((one) => [one.getAttribute('aria-label'), one.value]));
    by('limits').tBodies[0].replaceChildren(...rows.map((one) => {
      const row = make('tr');
      row.dataset.name = one.name;
      cell(row, `${one.name}, ${one.unit}`);
      const [low, high] = one.position || [];
      field(row, `${one.name}, from`, low, !one.position);
      field(row, `${one.name}, to`, high, !one.position);
      field(row, `${one.name}, largest rate`, one.rate ? one.rate[1] : undefined);
      field(row, `${one.name}, largest acceleration`, one.acceleration ? one.acceleration[1] : undefined);
      return row;
    }));
    for (const input of by('limits').querySelectorAll('input')) {
      const was = typed.get(input.getAttribute('aria-label'));
      if (was !== undefined) { input.value = was; input.removeAttribute('aria-invalid'); }
    }
    window.enlivenTables(by('limits'));
  }, 'limits');
  // Limits that differ from those of the model file, in the form of the option `--limits`.
  const given = () => {
    const all = [];
    for (const row of by('limits').tBodies[0].rows) {
      const [low, high, rate, acceleration] = [...row.querySelectorAll('input')];
      const { name } = row.dataset;
      if (low.value.trim() === '' || high.value.trim() === '')
        throw new Error(`${name} has no limits; enter the smallest and the largest position here, or under [limits.coordinates] in the model file`);
      const isNew = (input) => input.value.trim() !== input.dataset.was;
      if (isNew(low) || isNew(high)) all.push(`${name}=${low.value.trim()}:${high.value.trim()}`);
      for (const [input, [, ending]] of [[rate, KINDS[1]], [acceleration, KINDS[2]]])
        if (isNew(input) && input.value.trim() !== '') all.push(`${name}${ending}=${input.value.trim()}`);
    }
    return all;
  };

  // ---- the result

  const found = (told) => {
    const box = by('planned');
    box.replaceChildren();
    if (told.cancelled) box.append(make('p', 'The search was cancelled.'));
    if (told.failed) box.append(make('p', told.failed, 'alias'));
    const plan = told.found;
    if (!plan) return;
    if (!told.of_this_text) box.append(make('p', 'This result is of an earlier text. Search again for the current text.', 'alias'));
    box.append(make('p', plan.says, 'verdict'));
    for (const note of plan.notes) box.append(make('p', note.says));
    const table = make('table');
    const head = table.createTHead().insertRow();
    for (const [words, cls] of [['limit', ''], ['used', 'number'], ['checked', '']]) {
      const one = head.appendChild(make('th', words, cls));
      one.scope = 'col';
    }
    const body = table.createTBody();
    for (const limit of plan.limits) {
      const row = body.insertRow();
      cell(row, limit.name);
      amount(row, limit.used === null ? '\u2014' : `${number(100 * limit.used)} %`, limit.used);
      cell(row, limit.proven ? 'at all times' : 'at fine time steps');
    }
    const file = make('p');
    const name = make('input');
    Object.assign(name, { type: 'text', value: 'excitation.csv' });
    name.setAttribute('aria-label', 'Name of the file');
    name.style.width = '12rem';
    const button = (words, act) => {
      const one = make('button', words);
      one.type = 'button';
      one.addEventListener('click', () => tried(act));
      file.append(' ', one);
      return one;
    };
    file.append(`${plan.samples} samples of one period: `, name);
    button('Download', async () => {
      const { csv } = await ask('trajectory', {});
      const link = make('a');
      link.href = URL.createObjectURL(new Blob([csv], { type: 'text/csv' }));
      link.download = name.value;
      link.click();
      URL.revokeObjectURL(link.href);
    });
    if (window.mill.keeps) button('Save next to the model', async () => {
      const { path } = await ask('keep_trajectory', { name: name.value });
      say(`${path} is written.`);
    });
    const run = { file: 'planned motion', time: plan.time, q: plan.q };
    button('Show the motion of the mechanism', async () => animate(plan.names, run, true)).id = 'animate';
    const figure = make('figure');
    figure.innerHTML = plan.picture;
    box.append(file, figure, table);
    window.enlivenPictures(box);
    window.enlivenTables(table);
    animate(plan.names, run, false);
  };
  const follow = async () => {
    for (;;) {
      const told = await ask('excitation', {});
      const { going } = told;
      command = told.number > 0 && told.command ? told.command : command;
      by('excite').disabled = Boolean(going);
      by('stop-excitation').hidden = by('excitation-progress').hidden = !going;
      if (!going) {
        by('excitation-going').textContent = '';
        if ((told.found || told.failed || told.cancelled) && shown !== told.number) { shown = told.number; found(told); told_command(); }
        return;
      }
      by('excitation-going').textContent = `${going.what}, ${going.seconds.toFixed(0)} s`;
      if (going.total) Object.assign(by('excitation-progress'), { max: going.total, value: going.done });
      else by('excitation-progress').removeAttribute('value');
      await new Promise((done) => setTimeout(done, 200));
    }
  };

  by('excite').addEventListener('click', () => tried(async () => {
    await send();
    const asked = { limits: given() };
    for (const name of FIELDS) {
      asked[name] = Number(by(name).value);
      if (by(name).value.trim() === '' || !Number.isFinite(asked[name])) throw new Error(`${name}: a number is expected`);
    }
    by('planned').replaceChildren();
    await ask('excite', asked);
    say('');
    told_command();
    await follow();
  }));
  by('stop-excitation').addEventListener('click', () => tried(() => ask('stop_excitation', {})));
  document.addEventListener('pane', (event) => {
    isOpen = event.detail === 'excitation';
    limits();
  });
  heard.push(() => { limits(); if (shown < 0) follow().catch(() => {}); });
})();
