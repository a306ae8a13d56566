// The random streams of numpy: SeedSequence, PCG64 (XSL-RR 128/64) and what the library draws from a Generator.

const MASK_64 = (1n << 64n) - 1n;
const PCG_MULTIPLIER = 0x2360ed051fc65da44385df649fccf645n;

// A hash of words of 32 bits, whose multiplier moves on with each.
const hasher = (multiplier, factor) => (word) => {
  word ^= multiplier;
  multiplier = Math.imul(multiplier, factor);
  word = Math.imul(word, multiplier);
  return (word ^ (word >>> 16)) >>> 0;
};

// numpy.random.SeedSequence(entropy, spawn_key=...): a pool of four words, hashed from the seed. entropy: BigInt or number.
class SeedSequence {
  constructor(entropy, spawnKey = []) {
    const words = [];
    let rest = BigInt(entropy);
    do {
      words.push(Number(rest & 0xffffffffn));
      rest >>= 32n;
    } while (rest);
    while (spawnKey.length && words.length < 4) words.push(0);
    this.entropy = entropy;
    this.spawnKey = spawnKey;
    this.spawned = 0;
    this.pool = SeedSequence.mixed([...words, ...spawnKey]);
  }

  static mixed(words) {
    const hash = hasher(0x43b0d7e5, 0x931e8875);
    const joined = (x, y) => {
      const sum = (Math.imul(0xca01f9dd, x) - Math.imul(0x4973f715, y)) >>> 0;
      return (sum ^ (sum >>> 16)) >>> 0;
    };
    const pool = [0, 1, 2, 3].map((i) => hash(words[i] ?? 0));
    for (let from = 0; from < 4; from++)
      for (let to = 0; to < 4; to++) if (from !== to) pool[to] = joined(pool[to], hash(pool[from]));
    for (const word of words.slice(4)) for (let to = 0; to < 4; to++) pool[to] = joined(pool[to], hash(word));
    return pool;
  }

  // The first `count` words of 32 bits.
  generateState(count) {
    const hash = hasher(0x8b51f9dd, 0x58f38ded);
    return Array.from({ length: count }, (_, i) => hash(this.pool[i % 4]));
  }

  spawn(count) {
    return Array.from({ length: count }, () => new SeedSequence(this.entropy, [...this.spawnKey, this.spawned++]));
  }
}

// numpy.random.default_rng(seed). seed: a number, a BigInt or a SeedSequence.
class Generator {
  constructor(seed) {
    const sequence = seed instanceof SeedSequence ? seed : new SeedSequence(seed);
    const words = sequence.generateState(8).map(BigInt);
    const [a, b, c, d] = [0, 2, 4, 6].map((i) => words[i] | (words[i + 1] << 32n));
    this.increment = BigInt.asUintN(128, (((c << 64n) | d) << 1n) | 1n);
    this.state = 0n;
    this.advance();
    this.state += (a << 64n) | b;
    this.advance();
    this.half = null; // numpy keeps the upper half of a word for the next draw of 32 bits
  }

  advance() {
    this.state = BigInt.asUintN(128, this.state * PCG_MULTIPLIER + this.increment);
  }

  next64() {
    this.advance();
    const word = (this.state >> 64n) ^ (this.state & MASK_64);
    const turn = this.state >> 122n;
    return ((word >> turn) | (word << (64n - turn))) & MASK_64;
  }

  next32() {
    if (this.half !== null) {
      const kept = this.half;
      this.half = null;
      return kept;
    }
    const word = this.next64();
    this.half = Number(word >> 32n);
    return Number(word & 0xffffffffn);
  }

  // In [0, 1).
  random() {
    return Number(this.next64() >> 11n) * 2 ** -53;
  }

  uniform(low, high) {
    return low + (high - low) * this.random();
  }

  // 0, 1, ..., count - 1, by Lemire's rejection. count: below 2^21, so that the product is exact.
  integers(count) {
    const reject = 2 ** 32 % count;
    for (;;) {
      const product = this.next32() * count;
      if (product % 2 ** 32 >= reject) return Math.floor(product / 2 ** 32);
    }
  }
}
