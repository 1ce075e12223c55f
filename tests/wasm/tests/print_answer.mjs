// Prints what the module answers. It imports nothing: no files, no clock, no threads.
import { readFileSync } from "node:fs";

const module = new WebAssembly.Module(readFileSync(process.argv[2]));
const { exports } = new WebAssembly.Instance(module, {});
const [start, length] = [exports.answer_start(), exports.answer_length()];
// Memory that grew has another buffer than before.
const bytes = new Uint8Array(exports.memory.buffer, start, length);
console.log(new TextDecoder().decode(bytes));
