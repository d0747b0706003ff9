"""Context-modelled codes: an adaptive binary model of small whole numbers that mixes several contexts.

A number is told as yes-or-no decisions: is it 0, its sign, the number of binary digits behind the leading 1, and those
digits. Every context has its own adaptive probability of each decision; logistic mixing [Mattern 2012] makes one of
them, with weights that are learnt on the way. Numbers come in *batches*: within a batch all probabilities stand still,
so that an encoder can work on a whole batch at once, and a decoder that goes number by number follows it exactly.
`bits` is the code length, `encode` and `decode` are the arithmetic coder that has it (tests compare them; sizes are by
`bits`).
"""

import numpy as np

# Decisions: zero, 24 of "is the length above j", first and second digit behind the leading 1 by length.
LENGTHS = 24
DECISIONS = 1 + LENGTHS + LENGTHS + 2 * LENGTHS
# Counts above this are halved: what is long ago is forgotten.
MEMORY = 1024.0
FLOOR = 1 / 65536


class Model:
    """Adaptive probabilities: `sizes` are the numbers of values of each context, `choices` those of the mixing set."""

    def __init__(self, sizes, choices):
        self.sizes, self.choices = tuple(sizes), choices
        self.offsets = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
        count = int(np.sum(sizes))
        self.ones, self.all = np.zeros((DECISIONS, count)), np.zeros((DECISIONS, count))
        self.prior_ones, self.prior_all = np.full(DECISIONS, 0.5), np.ones(DECISIONS)
        inputs = len(self.sizes) + 1
        # Online Newton steps; the prior believes in the mean of all contexts, as worth some hundred decisions.
        self.weights = np.full((DECISIONS, choices, inputs), 1.0 / len(self.sizes))
        self.weights[:, :, -1] = 0
        self.curvature = np.tile(np.eye(inputs) * 40.0, (DECISIONS, choices, 1, 1))

    def predict(self, decision, contexts, choice):
        """(probability of a 1 [n], inputs [n, contexts + 1]) of a decision; `contexts` [contexts, n]."""
        prior = self.prior_ones[decision] / self.prior_all[decision]
        at = contexts + self.offsets[:, None]
        ones, total = self.ones[decision][at], self.all[decision][at]
        share = (ones + 1.5 * prior) / (total + 1.5)
        share = np.clip(share, 1e-5, 1 - 1e-5)
        inputs = np.empty((len(self.sizes) + 1, at.shape[1]))
        inputs[:-1] = np.log(share / (1 - share))
        inputs[-1] = 0.5
        weights = self.weights[decision][choice].T
        # Term by term, not as a matrix product: a decoder that asks for one number must get the same last bit.
        z = weights[0] * inputs[0]
        for w, x in zip(weights[1:], inputs[1:]):
            z = z + w * x
        return np.clip(1 / (1 + np.exp(-np.clip(z, -30, 30))), FLOOR, 1 - FLOOR), inputs

    def learn(self, decision, contexts, choice, bit, probability, inputs):
        """Takes the decisions of a batch in."""
        at = (contexts + self.offsets[:, None]).reshape(-1)
        many = np.broadcast_to(bit, contexts.shape).reshape(-1)
        width = self.all.shape[1]
        ones, total = self.ones[decision], self.all[decision]
        total += np.bincount(at, minlength=width)
        ones += np.bincount(at, many, minlength=width)
        full = total > MEMORY
        if full.any():
            ones[full] *= MEMORY / total[full]
            total[full] = MEMORY
        self.prior_ones[decision] += bit.sum()
        self.prior_all[decision] += len(bit)
        if self.prior_all[decision] > 65536:
            self.prior_ones[decision] /= 2
            self.prior_all[decision] /= 2
        spread = probability * (1 - probability)
        for c in np.unique(choice):
            mine = choice == c
            x = inputs[:, mine]
            curvature = self.curvature[decision, c]
            curvature *= 1 - min(len(x[0]), 20000) / 200000
            curvature += (x * spread[mine]) @ x.T + np.eye(len(x)) * 0.02
            self.weights[decision, c] += np.linalg.solve(curvature, x @ (bit - probability)[mine])

    def decisions(self, numbers):
        """[(decision, indices, bits)] of a batch, and lengths; without signs and lower digits, which have no model."""
        size = np.abs(numbers)
        told = [(np.zeros(1, int), np.arange(len(numbers)), (size > 0).astype(float))]
        left = np.flatnonzero(size > 0)
        length = np.zeros(len(numbers), int)
        length[left] = np.frexp(size[left].astype(float))[1] - 1
        digits = left
        for j in range(LENGTHS):
            if len(left) == 0:
                break
            longer = length[left] > j
            told.append((np.full(1, 1 + j), left, longer.astype(float)))
            left = left[longer]
        for j in range(1, int(length.max(initial=0)) + 1):
            at = digits[length[digits] == j]
            first = (size[at] >> (j - 1)) & 1
            told.append((np.full(1, LENGTHS + j), at, first.astype(float)))
            if j > 1:
                for f in (0, 1):
                    part = at[first == f]
                    told.append((np.full(1, 2 * LENGTHS - 1 + 2 * j + f), part,
                                 ((size[part] >> (j - 2)) & 1).astype(float)))
        return [(int(d[0]), at, bit) for d, at, bit in told if len(at)], length

    def bits(self, numbers, contexts, choice):
        """Code length of a batch in bits, one for each number; learns the batch."""
        numbers = np.asarray(numbers)
        cost = (numbers != 0).astype(float)
        told, length = self.decisions(numbers)
        cost += np.maximum(length - 2, 0)
        learnt = []
        for decision, at, bit in told:
            probability, inputs = self.predict(decision, contexts[:, at], choice[at])
            cost[at] -= np.log2(np.where(bit > 0, probability, 1 - probability))
            learnt.append((decision, contexts[:, at], choice[at], bit, probability, inputs))
        for one in learnt:
            self.learn(*one)
        return cost

    def code(self, coder, number, contexts, choice):
        """Encodes (or, with a Decoder, decodes) one number; does not learn: a batch is learnt when it is complete."""
        one, c = contexts.reshape(-1, 1), np.array([choice])

        def decide(decision, bit):
            return coder.bit(bit, self.predict(decision, one, c)[0][0])

        known = number is not None
        size = abs(number) if known else 0
        if not decide(0, size > 0 if known else None):
            return 0
        negative = coder.bit(number < 0 if known else None, 0.5)
        length, wanted = 0, size.bit_length() - 1
        while length < LENGTHS and decide(1 + length, wanted > length if known else None):
            length += 1
        value = 1
        for j in range(length - 1, -1, -1):
            bit = (size >> j) & 1 if known else None
            if j == length - 1:
                bit = decide(LENGTHS + length, bit)
            elif j == length - 2:
                bit = decide(2 * LENGTHS - 1 + 2 * length + (value & 1), bit)
            else:
                bit = coder.bit(bit, 0.5)
            value = 2 * value + int(bit)
        return -value if negative else value


class Encoder:
    """Binary arithmetic coder with carries in a whole number without bound; for tests, not for speed."""

    def __init__(self):
        self.low, self.range, self.shifts = 0, (1 << 32) - 1, 0

    def bit(self, bit, probability):
        bound = (self.range >> 16) * min(65535, max(1, round(65536 * (1 - probability))))
        if bit:
            self.low += bound
            self.range -= bound
        else:
            self.range = bound
        while self.range < 1 << 24:
            self.low, self.range, self.shifts = self.low << 8, self.range << 8, self.shifts + 1
        return bool(bit)

    def done(self):
        return self.low.to_bytes(self.shifts + 4, "big").rstrip(b"\0")


class Decoder:
    def __init__(self, data):
        self.data, self.at = data + b"\0\0\0\0", 4
        self.code, self.range = int.from_bytes(self.data[:4], "big"), (1 << 32) - 1

    def bit(self, _, probability):
        bound = (self.range >> 16) * min(65535, max(1, round(65536 * (1 - probability))))
        bit = self.code >= bound
        if bit:
            self.code -= bound
            self.range -= bound
        else:
            self.range = bound
        while self.range < 1 << 24:
            byte = self.data[self.at] if self.at < len(self.data) else 0
            self.code, self.range, self.at = self.code << 8 | byte, self.range << 8, self.at + 1
        return bit


def step_of(size, fineness=2.0, most=15):
    """Bins of a size (0 or more): 0, then `fineness` to a doubling."""
    return np.minimum(np.log2(1 + np.asarray(size)) * fineness + 0.5 * (np.asarray(size) > 0), most).astype(np.int64)


def bits_of(plan, numbers):
    """Code length in bits of `numbers` (an array of any shape) in the batches of `plan`.

    A plan has `model`, `batches`, `contexts(batch, numbers)` and `learn(batch, numbers)`, called after the batch.
    `contexts` gives (flat indices, contexts [context, n], choice [n]) and may look at no number that comes later.
    """
    bits, flat = 0.0, numbers.reshape(-1)
    for batch in plan.batches:
        at, contexts, choice = plan.contexts(batch, numbers)
        if len(at):
            bits += plan.model.bits(flat[at], contexts, choice).sum()
        plan.learn(batch, numbers)
    return bits


def encode(plan, numbers):
    """The bytes themselves; `plan` must be new."""
    coder, flat = Encoder(), numbers.reshape(-1)
    for batch in plan.batches:
        at, contexts, choice = plan.contexts(batch, numbers)
        for i, place in enumerate(at):
            plan.model.code(coder, int(flat[place]), contexts[:, i], int(choice[i]))
        if len(at):
            plan.model.bits(flat[at], contexts, choice)
        plan.learn(batch, numbers)
    return coder.done()


def decode(plan, data, shape):
    """The numbers again. Contexts are made anew for every number from what is decoded so far: slow, for tests."""
    coder, numbers = Decoder(data), np.zeros(shape, np.int64)
    flat = numbers.reshape(-1)
    for batch in plan.batches:
        at, contexts, choice = plan.contexts(batch, numbers)
        for i, place in enumerate(at):
            _, contexts, choice = plan.contexts(batch, numbers)
            flat[place] = plan.model.code(coder, None, contexts[:, i], int(choice[i]))
        if len(at):
            _, contexts, choice = plan.contexts(batch, numbers)
            plan.model.bits(flat[at], contexts, choice)
        plan.learn(batch, numbers)
    return numbers
