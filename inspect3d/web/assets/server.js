"use strict";
/* What a page asks its server, and what it says when the server is gone. */

const KINDS = { float32: Float32Array, float64: Float64Array, uint32: Uint32Array, int8: Int8Array, uint8: Uint8Array };

export class Refusal extends Error {}

async function answered(name, options) {
  let answer;
  try {
    answer = await fetch(name, options);
  } catch {
    gone();
    throw new Refusal("The server is gone.");
  }
  if (answer.status === 422) throw new Refusal(await answer.text());
  if (!answer.ok) throw new Error(`${name}: ${await answer.text()}`);
  return answer;
}

function address(name, query) { return query ? `${name}?${new URLSearchParams(query)}` : name; }

export async function ask(name, query) { return (await answered(address(name, query))).json(); }

/* Return named arrays: a length, a header, and the bytes of each. */
export async function askArrays(name, query) {
  const buffer = await (await answered(address(name, query))).arrayBuffer();
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const found = {};
  let at = 4 + length;
  for (const each of header) {
    const Kind = KINDS[each.kind];
    found[each.name] = new Kind(buffer.slice(at, at + each.count * Kind.BYTES_PER_ELEMENT));
    at += Math.ceil((each.count * Kind.BYTES_PER_ELEMENT) / 4) * 4;
  }
  return found;
}

export async function tell(name, body) {
  const options = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  return (await answered(name, options)).json();
}

const banner = document.getElementById("gone");
function gone() { banner.hidden = false; }

/* Say so when the server does not answer any more: the page then shows what it has, but saves nothing. */
export function watchServer() {
  const look = async () => {
    try {
      await fetch("alive");
      banner.hidden = true;
    } catch {
      gone();
    }
  };
  setInterval(look, 2000);
}

let timer = 0;
/* Say something in the line at the foot of the page. */
export function say(words, wrong = false) {
  const line = document.getElementById("said");
  line.textContent = words;
  line.classList.toggle("wrong", wrong);
  clearTimeout(timer);
  if (!wrong) timer = setTimeout(() => { line.textContent = ""; }, 12000);
}

/* Run what may be refused, and say why it was. */
export async function trying(action) {
  try {
    return await action();
  } catch (error) {
    if (!(error instanceof Refusal)) console.error(error);
    say(error.message, true);
    return undefined;
  }
}
