// Requests of a page that contains the program: one worker answers, another one diagnoses, so that the editor stays responsive.
// Work that takes too long is stopped by ending its worker.
(() => {
  'use strict';
  const by = (id) => document.getElementById(id);
  const unpacked = (id) => {
    const bytes = Uint8Array.from(atob(by(id).textContent.trim()), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
    return new Response(stream).arrayBuffer();
  };
  const source = URL.createObjectURL(new Blob([by('worker').textContent], { type: 'text/javascript' }));
  const module = unpacked('module').then((bytes) => WebAssembly.compile(bytes));
  const bundle = unpacked('bundle').then((bytes) => JSON.parse(new TextDecoder().decode(bytes)));
  const encode = (words) => new TextEncoder().encode(words);

  // The open files: the model file as saved, its last text that was derived, recordings.
  const desk = { model: '', saved: '', text: '', runs: [], others: [] };
  // Counts continue in the next session; the text has no other editor.
  let count = 0, revision = 0;

  // Starts a worker, which gets all open files.
  const hired = (heard) => {
    const worker = new Worker(source);
    const waiting = new Map();
    let asked = 0;
    const fail = (says) => {
      for (const { reject } of waiting.values()) reject(new Error(says));
      waiting.clear();
    };
    worker.onmessage = ({ data }) => {
      if (data.goes) { heard(data.goes); return; }
      const { resolve, reject } = waiting.get(data.id) || {};
      waiting.delete(data.id);
      if (data.fault) {
        one.isOver = true;
        worker.terminate();
        if (reject) reject(new Error(`internal error of the program, not of your input (${data.fault}); the text is kept`));
        fail('the program is started again');
      } else if (resolve) resolve(data.answer);
    };
    worker.onerror = (event) => { one.isOver = true; fail(event.message); };
    const send = (message) => new Promise((resolve, reject) => {
      const id = ++asked;
      waiting.set(id, { resolve, reject });
      worker.postMessage({ id, ...message });
    });
    const ask = async (question, body) => {
      const { status, told } = await send({ question, body });
      if (status === 200) return told;
      throw Object.assign(new Error(told.says), { status });
    };
    const one = {
      isOver: false,
      ask,
      end: () => { one.isOver = true; worker.terminate(); fail('the work was stopped'); },
      // Opens the saved text, then the current one.
      open: async () => {
        await send({ module: await module });
        for (const { name, bytes } of [...desk.others, ...desk.runs]) await send({ name, bytes });
        await send({ name: desk.model, bytes: encode(desk.saved) });
        const named = (isCheck) => desk.runs.filter((run) => run.isCheck === isCheck).map((run) => run.name);
        let told = await ask('open', { model: desk.model, data: named(false), check: named(false).length ? named(true) : [], first: count });
        if (desk.text !== desk.saved) told = await ask('edit', { base: told.revision, text: desk.text });
        return told;
      },
    };
    return one;
  };

  let answering = null, opening = null, awaited = null, fresh = null;
  const heard = (told) => {
    if (told && told.version) {
      count = Math.max(count, told.version, told.revision);
      revision = told.revision;
    }
    if (told && told.text !== undefined) { desk.text = told.text; if (!told.changed) desk.saved = told.text; }
    return told;
  };
  const begun = () => {
    if (!answering || answering.isOver) {
      answering = hired(() => {});
      opening = answering.open().then(heard);
    }
    return opening;
  };
  const tell = (told) => {
    fresh = told;
    if (awaited) awaited(told);
    awaited = null;
  };
  // Starts a new session for another model or other recordings, and notifies the page.
  const anew = () => {
    if (answering) answering.end();
    diagnosis.forget();
    excitation.forget();
    return begun().then(tell, () => {});
  };

  // ---- long work, each kind in a separate worker

  // Sends `question` to the worker. The worker is ended to cancel, and kept for later requests about the answer.
  const long = (question, words) => {
    let worker = null, asked = { number: 0 };
    const told = () => ({
      number: asked.number,
      going: asked.going ? { ...asked.going, seconds: (performance.now() - asked.since) / 1000 } : null,
      cancelled: Boolean(asked.cancelled),
      found: asked.found,
      failed: asked.failed,
      of_this_text: asked.text === desk.text,
    });
    return {
      told,
      begin: async (body) => {
        if (asked.going) throw new Error(`${words} is running; wait until it ends, or cancel it`);
        const mine = { number: ++count, text: desk.text, going: { what: 'starting', done: 0, total: 0 }, since: performance.now() };
        asked = mine;
        if (worker) worker.end();
        worker = hired((goes) => { mine.going = goes; });
        const { ask, open } = worker;
        open().then(() => ask(question, body)).then(
          (answer) => Object.assign(mine, { found: answer.found, failed: answer.failed }),
          (error) => { mine.failed = mine.cancelled ? null : error.message; },
        ).finally(() => { mine.going = null; });
        return told();
      },
      cancel: () => {
        if (asked.going) {
          asked.cancelled = true;
          asked.going = null;
          worker.end();
        }
        return told();
      },
      // The worker that has the answer.
      holder: (says) => {
        if (!worker || worker.isOver || !asked.found) throw new Error(says);
        return worker;
      },
      forget: () => {
        if (worker) worker.end();
        worker = null;
        asked = { number: asked.number };
      },
    };
  };
  const diagnosis = long('diagnose', 'a diagnosis'), excitation = long('excite', 'a search');
  // The text with a finding, by the same edit as `add`.
  const edit = async ({ text, did }) => heard(await answering.ask('edit', { base: revision, text, did }));
  const add = async ({ entry }) => {
    const finding = diagnosis.holder('there is no such finding; run the diagnosis again');
    const { kind, at } = diagnosis.told().found.entries[entry];
    const theirs = await finding.ask('view');
    await finding.ask('edit', { base: theirs.revision, text: desk.text });
    const { text } = await finding.ask('add', { entry });
    return edit({ text, did: `+ ${kind.replaceAll('_', ' ')} (${at.join(', ')})` });
  };
  const save = async (body) => {
    const told = heard(await answering.ask('save', body));
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([told.text], { type: 'application/toml' }));
    link.download = desk.model;
    link.click();
    URL.revokeObjectURL(link.href);
    return told;
  };

  const own = {
    edit, add, save,
    diagnose: diagnosis.begin, diagnosis: diagnosis.told, cancel: diagnosis.cancel,
    excite: excitation.begin, excitation: excitation.told, stop_excitation: excitation.cancel,
    trajectory: () => excitation.holder('there is no trajectory; search for one first').ask('trajectory', {}),
  };
  const ask = async (question, body) => {
    await begun();
    if (question in own) return own[question](body);
    const told = heard(await answering.ask(question, body));
    // The comparison may have added a step to the session.
    if (question === 'compare') answering.ask('view').then(heard).then(tell, () => {});
    return told;
  };
  // The first view at once, a later one after the next change.
  const news = async (version) => {
    if (!version) return ready.then(() => ask('view'));
    return fresh && fresh.version > version ? fresh : new Promise((done) => { awaited = done; });
  };

  // ---- open files

  const runs = () => {
    by('runs').replaceChildren(...desk.runs.map((run, k) => {
      const item = document.createElement('li');
      const use = document.createElement('select');
      use.setAttribute('aria-label', `Use of ${run.name}`);
      for (const [words, isCheck] of [['fit', false], ['validation', true]]) use.append(new Option(words, isCheck ? 'check' : 'fit', false, run.isCheck === isCheck));
      use.addEventListener('change', () => { run.isCheck = use.value === 'check'; anew(); });
      const away = document.createElement('button');
      Object.assign(away, { type: 'button', textContent: '\u00d7' });
      away.setAttribute('aria-label', `Remove ${run.name}`);
      away.addEventListener('click', () => { desk.runs.splice(k, 1); runs(); anew(); });
      item.append(run.name, ' ', use, ' ', away);
      return item;
    }));
  };
  const start = (name, bundle) => {
    const [, text] = bundle.models.find((one) => one[0] === name);
    const of = bundle.recordings.filter((one) => one[0] === name);
    Object.assign(desk, {
      model: name, saved: text, text,
      runs: of.map(([, run, words, isCheck]) => ({ name: run, bytes: encode(words), isCheck })),
      others: bundle.models.filter((one) => one[0] !== name).map(([other, words]) => ({ name: other, bytes: encode(words) })),
    });
    runs();
  };
  const isSafe = () => desk.text === desk.saved || confirm(`${desk.model} has unsaved changes. Open another model and lose them?`);
  const take = async (files) => {
    let isNew = false;
    for (const file of files) {
      if (file.name.endsWith('.toml')) {
        if (!isSafe()) continue;
        const text = await file.text();
        Object.assign(desk, { model: file.name, saved: text, text });
        by('bundled').value = '';
      } else {
        const bytes = new Uint8Array(await file.arrayBuffer());
        desk.runs = desk.runs.filter((run) => run.name !== file.name);
        desk.runs.push({ name: file.name, bytes, isCheck: false });
      }
      isNew = true;
    }
    runs();
    if (isNew) await anew();
  };
  const ready = bundle.then((all) => {
    by('bring').hidden = false;
    by('bundled').append(...all.models.map(([name]) => new Option(name.replace('.toml', ''), name)));
    const wanted = `${location.hash.slice(1)}.toml`;
    const first = all.models.some(([name]) => name === wanted) ? wanted : 'spidermill.toml';
    by('bundled').value = first;
    start(first, all);
    by('bundled').addEventListener('change', () => {
      if (!isSafe()) { by('bundled').value = desk.model; return; }
      start(by('bundled').value, all);
      anew();
    });
    for (const id of ['model-file', 'run-files']) by(id).addEventListener('change', () => { take([...by(id).files]).finally(() => { by(id).value = ''; }); });
    document.addEventListener('dragover', (event) => event.preventDefault());
    document.addEventListener('drop', (event) => {
      if (!event.dataTransfer.files.length) return;
      event.preventDefault();
      take([...event.dataTransfer.files]);
    });
    by('stop').addEventListener('click', () => answering.end());
  });
  // The user can stop a derivation that takes long.
  window.mill = {
    ask, news,
    slow: (isSlow) => { by('stop').hidden = !isSlow; },
    hint: 'No recording is open: drop one on the page (CSV, Parquet, MCAP, HDF5, \u2026), or choose a file above.',
  };
})();
