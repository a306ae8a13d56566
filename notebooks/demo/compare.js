// Rules beside each other: a rule as a text for an address, and what many seeds say together.

// A rule with its options, written as in homing_lib's settings, such as "gate:on_zero=1"; one's own is written out after
// them, "own:unclipped:0.5 * delta". Throws Error or RuleError, a sentence.
function ruleOf(text) {
  const [, options, own] = /^own((?::on_zero=[^:]*|:unclipped)*):(.*)$/.exec(text) ?? [];
  const told = own === undefined ? parseRule(text) : { ...parseRule(`fixed:0${options}`), rule: ownRule(own) };
  if (!(told.onZero >= 0 && told.onZero <= 1)) throw new Error(`on_zero must lie in [0, 1], in “${text}”`);
  return { ...told, text, own, setting: own === undefined ? text : `fixed:0${options}` };
}

// As scipy.stats.trim_mean(values, 0.25): the mean of the middle half.
function iqm(values) {
  const sorted = Float64Array.from(values).sort(), cut = Math.floor(sorted.length / 4);
  return sum([...sorted.subarray(cut, sorted.length - cut)]) / (sorted.length - 2 * cut);
}

const RESAMPLES = 400;
const resamples = new Map(); // indices, by number of seeds

// Interquartile mean and its 95 % interval, from a percentile bootstrap over the seeds.
function typical(values) {
  const n = values.length;
  if (!resamples.has(n)) {
    const rng = new Generator(0);
    resamples.set(n, Array.from({ length: RESAMPLES }, () => Array.from({ length: n }, () => rng.integers(n))));
  }
  const again = Float64Array.from(resamples.get(n), (draws) => iqm(draws.map((i) => values[i]))).sort();
  const percentile = (share) => {
    const place = share * (RESAMPLES - 1), below = Math.floor(place);
    return again[below] + (place - below) * (again[below + 1] - again[below]);
  };
  return { value: iqm(values), low: percentile(0.025), high: percentile(0.975) };
}
