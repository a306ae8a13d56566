// What many seeds say together.

// As scipy.stats.trim_mean(values, 0.25): the mean of the middle half.
function iqm(values) {
  const sorted = Float64Array.from(values).sort(), cut = Math.floor(sorted.length / 4);
  return sum([...sorted.subarray(cut, sorted.length - cut)]) / (sorted.length - 2 * cut);
}

const RESAMPLES = 400;
const resamples = new Map(); // indices of seeds, by their number

// Interquartile mean and its 95 % interval, from a percentile bootstrap over the seeds.
function iqmInterval(values) {
  const n = values.length;
  const draws = remember(resamples, n, () => {
    const rng = new Generator(0);
    return Array.from({ length: RESAMPLES }, () => Array.from({ length: n }, () => rng.integers(n)));
  });
  const means = Float64Array.from(draws, (draw) => iqm(draw.map((i) => values[i]))).sort();
  const percentile = (share) => {
    const place = share * (RESAMPLES - 1), below = Math.floor(place);
    return means[below] + (place - below) * (means[below + 1] - means[below]);
  };
  return { value: iqm(values), low: percentile(0.025), high: percentile(0.975) };
}
