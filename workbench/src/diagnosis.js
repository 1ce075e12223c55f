// The pane of the diagnosis: its progress, its findings, and effects that are added to the text.
(() => {
  'use strict';
  const { ask, make, number, percent, say, tried, send, take, go, line_of, mark_stale, made_of, view, heard } = window.workbench;
  const by = (id) => document.getElementById(id);
  const text = by('text');
  let shown = -1;
  const findings = (told) => {
    const box = by('found');
    box.replaceChildren();
    listed(box, told);
    made_of('found', told.of_this_text ? String(view().revision) : '');
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
          await send();
          const before = text.value;
          // The new text may arrive by a notification before the response does.
          await take(await ask('add', { entry: k }));
          say('');
          go(line_of(window.texts.edit_between(before, text.value).from));
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
  // Shows the progress of a diagnosis until it ends, then its findings. One such loop is enough.
  let isFollowing = false;
  const follow = async () => {
    if (isFollowing) return;
    isFollowing = true;
    try {
      while (await is_running()) await new Promise((done) => setTimeout(done, 200));
    } finally { isFollowing = false; }
  };
  const is_running = async () => {
    const told = await ask('diagnosis', {});
    const { going } = told;
    by('diagnose').disabled = Boolean(going) || !view().data;
    by('cancel').hidden = !going;
    // A bar without a known share would show nothing.
    by('progress').hidden = !going || !going.total;
    if (!going) {
      by('going').textContent = '';
      if (told.number > 0 && shown !== told.number) { shown = told.number; findings(told); }
      return false;
    }
    const share = going.total ? ` (${percent(going.done / going.total)} of it)` : '';
    by('going').textContent = `${going.step ? `step ${going.step}: ` : ''}${going.what}${share}, ${going.seconds.toFixed(0)} s so far`;
    if (going.total) Object.assign(by('progress'), { max: going.total, value: going.done });
    return true;
  };
  by('diagnose').addEventListener('click', () => tried(async () => {
    await send();
    by('found').replaceChildren();
    mark_stale('found');
    await ask('diagnose', {});
    say('');
    await follow();
  }));
  by('cancel').addEventListener('click', () => tried(() => ask('cancel', {})));
  heard.push(() => { follow().catch(() => {}); });
})();
