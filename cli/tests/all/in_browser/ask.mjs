// Asks the module what a page would ask, and prints the answers. Questions come as JSON on standard input: files to put there,
// and pairs of a question and its body.
import { readFileSync } from "node:fs";

const module = new WebAssembly.Module(readFileSync(process.argv[2]));
let mill = null;
const bytes = (start, length) => new Uint8Array(mill.memory.buffer, start, length);
let heard = 0;
const lent = { seconds: () => performance.now() / 1000, goes: (start, length) => { JSON.parse(new TextDecoder().decode(bytes(start, length))); heard += 1; } };
mill = new WebAssembly.Instance(module, { mill: lent }).exports;
const give = (head, body) => {
  const [a, b] = [head, body].map((words) => new TextEncoder().encode(words));
  const room = bytes(mill.reserve(a.length + b.length), a.length + b.length);
  room.set(a);
  room.set(b, a.length);
  return a.length;
};
const { files, questions } = JSON.parse(readFileSync(0, "utf8"));
for (const [name, text] of files) mill.put(give(name, text));
const answers = questions.map(([question, body]) => {
  const length = mill.ask(give(question, JSON.stringify(body)));
  return JSON.parse(new TextDecoder().decode(bytes(mill.answer(), length)));
});
console.log(JSON.stringify({ answers, heard }));
