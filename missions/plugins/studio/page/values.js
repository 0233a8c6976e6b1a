// Substitution of known values for `${...}` in texts of a mission.

const PLACEHOLDER = /\$\{((?:[^{}'"]|'[^']*'|"[^"]*")*)\}/g;
// A text, a number with its unit, a member, or a name and the sign after it.
const TOKEN = /'[^']*'|"[^"]*"|\d[\d.]*\s*\p{ID_Continue}*|\.\p{ID_Continue}+|([\p{ID_Start}_]\p{ID_Continue}*)(\s*[.([])?/gu;
const WORDS = new Set(["and", "or", "not", "in", "is", "if", "else", "true", "false", "null", "none", "True", "False", "None"]);

/** Return an expression with the values of its names; undefined if one is unknown. */
function substitute(expression, value) {
  if (/^\s*[\p{ID_Start}_]\p{ID_Continue}*\s*$/u.test(expression)) return value(expression.trim());
  let all = true;
  const text = expression.replace(TOKEN, (found, name, follows) => {
    if (!name || WORDS.has(name) || follows?.trim() === "(") return found;
    const text_of_name = follows ? undefined : value(name);
    all &&= text_of_name !== undefined;
    return text_of_name ?? found;
  });
  return all ? text.trim() : undefined;
}

/** Return the pieces of a text: texts, and pairs of a value and its placeholder. `value` looks up a name. */
export function filled(text, value) {
  const pieces = [];
  let end = 0;
  for (const placeholder of text.matchAll(PLACEHOLDER)) {
    const found = substitute(placeholder[1], value);
    if (found === undefined) continue;
    pieces.push(text.slice(end, placeholder.index), [found, placeholder[0]]);
    end = placeholder.index + placeholder[0].length;
  }
  return [...pieces, text.slice(end)].filter((piece) => piece !== "");
}

export function whole(text, value) {
  const pieces = filled(text, value);
  const missing = pieces.some((piece) => typeof piece === "string" && piece.includes("${"));
  return missing ? undefined : pieces.map((piece) => (typeof piece === "string" ? piece : piece[0])).join("");
}
