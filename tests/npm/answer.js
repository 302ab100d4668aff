// What the pages of these tests have in common.

// Errors of the console, and errors and warnings.
export const [errors, complaints] = [[], []];
for (const [kind, lists] of [['error', [errors, complaints]], ['warn', [complaints]]]) {
  const say = console[kind];
  console[kind] = (...words) => { lists.forEach((list) => list.push(words.join(' '))); say.apply(console, words); };
}

// Sends the server what `show` answers to its request, or the error.
export async function answer(show) {
  let result;
  try {
    result = await show(await (await fetch('/request.json')).json());
  } catch (error) {
    result = { error: String(error.stack ?? error) };
  }
  await fetch('/result', { method: 'POST', body: JSON.stringify(result) });
}
