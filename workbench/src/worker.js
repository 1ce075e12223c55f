// A worker with its own instance of the program: it answers one request after the other, and may be ended at any time.
let mill = null, last = Promise.resolve();
const encode = (words) => new TextEncoder().encode(words);
const text = (start, length) => new TextDecoder().decode(new Uint8Array(mill.memory.buffer, start, length));
const give = (head, body) => {
  const start = mill.reserve(head.length + body.length);
  const room = new Uint8Array(mill.memory.buffer, start, head.length + body.length);
  room.set(head);
  room.set(body, head.length);
  return head.length;
};
const done = async ({ module, name, bytes, question, body }) => {
  if (module) {
    const lent = {
      seconds: () => performance.now() / 1000,
      goes: (start, length) => postMessage({ goes: JSON.parse(text(start, length)) }),
    };
    mill = (await WebAssembly.instantiate(module, { mill: lent })).exports;
    return null;
  }
  if (bytes) return mill.put(give(encode(name), bytes));
  const length = mill.ask(give(encode(question), encode(JSON.stringify(body ?? {}))));
  return JSON.parse(text(mill.answer(), length));
};
onmessage = ({ data }) => {
  last = last.then(() => done(data)).then((answer) => postMessage({ id: data.id, answer }), (fault) => postMessage({ id: data.id, fault: String(fault) }));
};
