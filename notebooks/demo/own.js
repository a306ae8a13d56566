// A rule of one's own, typed as one expression of Python. It is read and computed here and never handed to the browser as
// code, so that a link with a rule in it can do no harm.

const VECTORS = { phi: "phi", phi_prev: "phiPrev", trace_prev: "tracePrev" };
const NUMBERS = { delta: "delta", delta_prev: "deltaPrev", discount: "discount" };
const ALIASES = {
  gamma: "discount", "@": "·",
  "δ": "delta", "δ₋": "delta_prev", "φ": "phi", "φ₋": "phi_prev", "e₋": "trace_prev", "γ": "discount",
};
const FUNCTIONS = {
  abs: [1, 1, Math.abs],
  sign: [1, 1, Math.sign],
  sqrt: [1, 1, Math.sqrt],
  exp: [1, 1, Math.exp],
  log: [1, 1, Math.log],
  min: [2, 9, Math.min],
  max: [2, 9, Math.max],
};
const WORDS = ["if", "else", "and", "or", "not"];

// Operators that are read from the left, the loosest last; a and b are worked out when a step is known, b only if need be.
const PRODUCTS = {
  "*": (a, b) => (s) => a(s) * b(s),
  "·": (a, b) => (s) => a(s) * b(s),
  "/": (a, b) => (s) => defined(a(s) / b(s)),
  "%": (a, b) => (s) => defined(a(s) - b(s) * Math.floor(a(s) / b(s))),
};
const SUMS = { "+": (a, b) => (s) => a(s) + b(s), "-": (a, b) => (s) => a(s) - b(s) };
const CONJUNCTIONS = { and: (a, b) => (s) => a(s) && b(s) };
const DISJUNCTIONS = { or: (a, b) => (s) => a(s) || b(s) };
const COMPARISONS = {
  "<": (a, b) => a < b, "<=": (a, b) => a <= b, ">": (a, b) => a > b, ">=": (a, b) => a >= b,
  "==": (a, b) => a === b, "!=": (a, b) => a !== b,
};

class Undefined extends Error {} // x/0 and the like: the guard stands in

function defined(value) {
  if (!Number.isFinite(value)) throw new Undefined();
  return value;
}

const UNREADABLE = {
  "=": "To compare, write ==.", "^": "A power is written **.", "λ": "λ itself is what you compute.",
  "[": "Vectors are asked by dot(phi, phi_prev).", ".": "Functions stand alone: dot(phi, phi_prev), sign(delta).",
  ";": "One expression is enough, without a semicolon.", "?": "Write a if condition else b.", "&": "Write and.",
  "|": "Write or; of numbers, abs(...).", "!": "Write not.",
};

const NUMBER = /(?<number>(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)/;
const NAME = /(?<name>[δφe]₋|[δφγ]|[A-Za-z_]\w*)/;
const SIGN = /(?<sign>\*\*|[<>=!]=|[-+*/%<>(),·@])/;
const TOKEN = new RegExp(`\\s*(?:${NUMBER.source}|${NAME.source}|${SIGN.source}|(?<odd>\\S))`, "gi");

function tokens(text) {
  text = text.replace(/\|(φ₋?)\|²/g, "dot($1, $1)").replace(/[−–]/g, "-").replaceAll("×", "*").replace(/\b(np|numpy|math)\./g, "");
  return Array.from(text.matchAll(TOKEN), ({ groups: { number, name, sign, odd } }) => {
    if (odd) throw new Error(`“${odd}” cannot be read here. ${UNREADABLE[odd] ?? ""}`.trim());
    if (number) return { number: Number(number), text: number };
    const known = Object.hasOwn(ALIASES, name ?? sign) ? ALIASES[name ?? sign] : name ?? sign;
    return name ? { name: known, text: name } : { text: known };
  });
}

// Whether a rule has no value at two ordinary steps.
function neverDefined(rule) {
  const vector = Float64Array.of(1, 0.5), step = { phi: vector, phiPrev: vector, tracePrev: vector, discount: 1 };
  return [[0.5, 0.25], [0.5, -0.25]].every(([delta, deltaPrev]) => Number.isNaN(rule({ ...step, delta, deltaPrev })));
}

// How many letters must change to make one word of the other.
function distance(a, b) {
  let row = Array.from({ length: b.length + 1 }, (_, j) => j);
  for (let i = 1; i <= a.length; i++) {
    const next = [i];
    for (let j = 1; j <= b.length; j++)
      next.push(Math.min(row[j] + 1, next[j - 1] + 1, row[j - 1] + (a[i - 1] !== b[j - 1])));
    row = next;
  }
  return row[b.length];
}

// The rule that a text describes, by recursive descent: each function reads what binds more tightly than the one before it,
// and returns what a step makes of it, or the name of a vector. Throws an Error for the reader.
function ownRule(text) {
  const list = tokens(text.replace(/^\s*return\b/, ""));
  let at = 0;
  const peek = (...texts) => at < list.length && list[at].number === undefined && texts.includes(list[at].text);
  const take = (...texts) => (peek(...texts) ? list[at++].text : null);
  const here = () => (at < list.length ? `before “${list[at].text}”` : "at the end");
  const comma = /\d,\d/.test(text) ? " A number is written with a point: 0.5." : "";

  const isVector = (node) => typeof node === "string";
  const scalar = (node, what) => {
    if (isVector(node)) throw new Error(`${node} is a vector, and ${what} takes a number: dot(${node}, phi) is one.`);
    return node;
  };
  const inner = (nodes, what) => {
    if (!nodes.every(isVector)) throw new Error(`${what}: phi, phi_prev or trace_prev.`);
    const [a, b] = nodes.map((node) => VECTORS[node]);
    return (s) => dot(s[a], s[b]);
  };
  const need = (sign, why) => {
    if (!take(sign)) throw new Error(`A “${sign}” is missing ${here()}${why}.${comma}`);
  };

  function choice() {
    const first = either();
    if (take("if")) {
      const condition = scalar(either(), "if");
      need("else", ": write a if condition else b");
      const [yes, no] = [scalar(first, "if"), scalar(choice(), "else")];
      return (s) => (condition(s) ? yes(s) : no(s));
    }
    return first;
  }

  // Operators that are read from the left.
  const leftToRight = (operators, operand) => () => {
    let left = operand();
    for (let sign; (sign = take(...Object.keys(operators))); ) {
      const [a, b] = [scalar(left, sign), scalar(operand(), sign)];
      left = operators[sign](a, b);
    }
    return left;
  };
  const term = leftToRight(PRODUCTS, signed);
  const total = leftToRight(SUMS, term);
  const both = leftToRight(CONJUNCTIONS, inverted);
  const either = leftToRight(DISJUNCTIONS, both);

  function inverted() {
    if (!take("not")) return comparison();
    const a = scalar(inverted(), "not");
    return (s) => +!a(s);
  }

  // As in Python, a < b < c means both.
  function comparison() {
    const compared = [total()], signs = [];
    for (let sign; (sign = take(...Object.keys(COMPARISONS))); ) {
      signs.push(sign);
      compared.push(total());
    }
    if (!signs.length) return compared[0];
    const parts = compared.map((node) => scalar(node, signs[0]));
    return (s) => {
      const values = parts.map((part) => part(s));
      return +signs.every((sign, i) => COMPARISONS[sign](values[i], values[i + 1]));
    };
  }

  function signed() {
    const sign = take("-", "+");
    if (!sign) return power();
    const a = scalar(signed(), sign);
    return sign === "-" ? (s) => -a(s) : a;
  }

  function power() {
    const base = vectors();
    if (!take("**")) return base;
    const [a, b] = [scalar(base, "**"), scalar(signed(), "**")];
    return (s) => defined(a(s) ** b(s));
  }

  // Of two vectors: it binds as tightly as a name.
  function vectors() {
    const left = atom();
    return isVector(left) && take("·") ? inner([left, atom()], `${left}· takes another vector`) : left;
  }

  function atom() {
    const token = list[at];
    if (!list.length) throw new Error("Type what lambda shall be, such as 0.5 or delta / delta_prev.");
    if (!token) throw new Error("Something is missing at the end.");
    if (token.number !== undefined) {
      at++;
      return () => token.number;
    }
    if (take("(")) {
      const enclosed = choice();
      need(")", "");
      return enclosed;
    }
    if (!token.name || WORDS.includes(token.name)) throw new Error(`A number or a name is missing ${here()}.`);
    at++;
    return named(token.name);
  }

  function named(name) {
    if (name === "True" || name === "False") return () => +(name === "True");
    if (Object.hasOwn(NUMBERS, name)) return (s) => s[NUMBERS[name]];
    if (Object.hasOwn(VECTORS, name)) return name;
    if (name === "dot") return inner(parameters(name, 2, 2), "dot takes two vectors");
    if (Object.hasOwn(FUNCTIONS, name)) {
      const [least, most, apply] = FUNCTIONS[name];
      const parts = parameters(name, least, most).map((node) => scalar(node, name));
      return (s) => defined(apply(...parts.map((part) => part(s))));
    }
    const known = [NUMBERS, VECTORS, FUNCTIONS, { dot }].flatMap((names) => Object.keys(names));
    const [nearest] = known.toSorted((a, b) => distance(name, a) - distance(name, b));
    if (/^lamb?da/.test(name)) throw new Error("λ is what you compute here: write its value, such as delta / delta_prev.");
    const guess = distance(name, nearest) <= Math.max(1, name.length / 3) ? `Did you mean ${nearest}? ` : "";
    throw new Error(`“${name}” is not known. ${guess}There are ${known.join(", ")}.`);
  }

  function parameters(name, least, most) {
    need("(", `: write ${name}(...)`);
    const found = [];
    if (!peek(")")) do found.push(choice()); while (take(","));
    need(")", "");
    if (found.length < least || found.length > most)
      throw new Error(`${name} takes ${least === most ? least : `at least ${least}`} of them, not ${found.length}.${comma}`);
    return found;
  }

  const value = scalar(choice(), "λ");
  if (at < list.length) {
    if (peek(")")) throw new Error("A “)” has no “(” before it.");
    throw new Error(`“${list[at].text}” does not fit there. Is an operator missing before it?${comma}`);
  }
  return (step) => {
    try {
      return defined(value(step));
    } catch (error) {
      if (error instanceof Undefined) return NaN;
      throw error;
    }
  };
}
