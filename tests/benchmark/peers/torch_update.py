#!/usr/bin/env python3
"""The update of the model dreamer in PyTorch, timed.

    torch_update.py GOLDEN_FOLDER PRESET=FILE...

The update is stated by GOLDEN_FOLDER/golden.py, which the model's golden test stands on.
Two things that golden.py writes down for plainness are replaced by what one would write for
speed: lambda-returns by their recursion, and the observations' moments by running sums. That
this still is the same update is checked against the golden data, in double and in single
precision, before anything is timed. Timed is single precision, draws of noise and starts
included. FILE is from write_golden_input --preset.
"""
import ctypes
import json
import sys
from pathlib import Path

from turns import serve

# Sequences and their length, as in model_dreamer_benchmark.cc.
BATCHES = {"fast": (16, 32), "paper": (50, 50)}


def agent_class(golden, torch):
    def lambda_returns(s, rewards, discounts, values):
        total, returns = values[-1], []
        for tau in reversed(range(len(rewards))):
            later = (1 - s.lambda_mix) * values[tau + 1] + s.lambda_mix * total
            total = rewards[tau] + discounts[tau] * later
            returns.append(total)
        return torch.stack(returns[::-1])

    golden.lambda_returns = lambda_returns

    class Agent(golden.Agent):
        count, total, squares = 0, 0.0, 0.0

        def standardise(self, raw):
            s = self.s
            if not s.normalise_observations:
                return raw
            rows = raw.reshape(-1, self.o).double()
            self.count += len(rows)
            self.total = self.total + rows.sum(0)
            self.squares = self.squares + (rows ** 2).sum(0)
            mean = self.total / self.count
            variance = (self.squares / self.count - mean ** 2).clamp(min=0)
            deviation = variance.sqrt().clamp(min=s.observation_floor)
            x = (rows - mean) / deviation
            x = x.clamp(-s.observation_clip, s.observation_clip)
            return x.to(raw.dtype).reshape(raw.shape)

    return Agent


def check(agent_of, folder, tolerance):
    """The losses of every golden update, relative to the size of their terms."""
    compared = 0
    for path in sorted(folder.glob("*_input.json")):
        data = json.loads(path.read_text())
        expected = json.loads(path.with_name(path.name.replace("_input", "_output")).read_text())
        agent = agent_of(data)
        for update, golden in zip(data["updates"], expected["updates"]):
            report, _ = agent.update(update)
            for name, value in golden["losses"].items():
                found = float(report["losses"][name])
                scale = max(abs(value), golden["scales"].get(name, 0))
                # A not-a-number fails.
                if not abs(found - value) <= tolerance * (scale + 1e-3):
                    raise ValueError(f"{path.name}: {name} is {found}, the golden data say {value}")
                compared += 1
    if compared == 0:
        raise ValueError(f"no golden data in {folder}")


def check_products(torch):
    """Products of small whole numbers are exact, whatever the order of their sums. (Some kernels of
    older OpenBLAS compute wrong ones on some processors.)"""
    for rows, inner, columns in ((200, 230, 32), (128, 160, 33), (33, 24, 128)):
        a, b = (torch.randint(-4, 5, shape).float() for shape in ((rows, inner), (inner, columns)))
        if not torch.equal(a @ b, (a[:, :, None] * b).sum(1)):
            raise ValueError(f"a wrong product, {rows} x {inner} x {columns}")


def product_library():
    """Which library computes the products, and with which of its kernels, as far as it tells."""
    facts = {"products by": "PyTorch's own library"}
    mapped = (line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines())
    for path in sorted({Path(name).resolve() for name in mapped if "blas" in Path(name).name}):
        facts = {"products by": path.name}
        if "openblas" in path.name:
            name = ctypes.CDLL(str(path)).openblas_get_corename
            name.restype = ctypes.c_char_p
            return {**facts, "kernel": name().decode()}
    return facts


def timed_case(torch, agent, sequences, length):
    s, rows = agent.s, sequences * length
    batch = {
        "sequences": sequences, "length": length,
        "observations": torch.randn(rows, agent.o), "actions": 2 * torch.rand(rows, agent.a) - 1,
        "rewards": 2 * torch.rand(rows), "discounts": torch.ones(rows),
    }
    first = s.start_skip * sequences  # time is the slower index
    starts = rows - first
    if s.imagination_starts > 0:
        starts = min(starts, s.imagination_starts)

    def update():
        agent.update({
            **batch,
            "starts": first + torch.randperm(rows - first)[:starts],
            "posterior_noise": torch.randn(rows, s.stochastic),
            "latent_noise": torch.randn(s.horizon, starts, s.stochastic),
            "action_noise": torch.randn(s.horizon, starts, agent.a),
        })

    return update


def prepare():
    folder = Path(sys.argv[1])
    sys.path.insert(0, str(folder))
    import golden  # double, one thread
    import torch

    agent_of = agent_class(golden, torch)
    check(agent_of, folder, 1e-9)
    torch.set_default_dtype(torch.float32)
    check(agent_of, folder, 1e-4)
    torch.manual_seed(1)
    check_products(torch)
    cases = {}
    for argument in sys.argv[2:]:
        preset, _, file = argument.partition("=")
        agent = agent_of(json.loads(Path(file).read_text()))
        cases[preset] = (timed_case(torch, agent, *BATCHES[preset]), 1)
    return {"PyTorch": torch.__version__, **product_library()}, cases


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    serve(prepare)
