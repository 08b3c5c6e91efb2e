#!/usr/bin/env python3
"""The update of world model, actor and critic with PyTorch, in double.

    golden.py FOLDER

reads FOLDER/NAME_input.json and writes FOLDER/NAME_output.json. The formulas are
those of the papers and of the settings' help, written with torch's own layers,
distributions, derivatives and optimiser; nothing is shared with the C++ model but
names, shapes and the order of the draws.

Columns of sequences are [T, B], of dreams [H, K]: time first. A state is [z, h].
"""
import math
import sys
from pathlib import Path

import torch
from torch.distributions import Independent, Normal, kl_divergence
from torch.nn import functional as F

sys.path.append(str(Path(__file__).resolve().parents[2] / "networks"))
from golden_tools import GoldenAgent, Searches, remake  # noqa: E402

torch.set_default_dtype(torch.float64)
torch.set_num_threads(1)

SETTINGS = {
    "deterministic", "stochastic", "hidden", "encoder_layers", "decoder_layers", "reward_layers",
    "continuation_layers", "actor_layers", "value_layers", "norm", "normalise_observations",
    "observation_floor", "observation_clip", "observation_weight", "reward_weight", "kl_scale",
    "kl_prior_factor", "kl_posterior_factor", "free_nats", "free_nats_over", "min_std",
    "continuation", "continuation_scale", "horizon", "imagination_starts", "start_skip",
    "discount", "lambda", "actor_mean_limit", "actor_initial_std", "actor_min_std",
    "entropy_scale", "return_scale", "return_scale_rate", "value_scale", "slow_critic_weight",
    "slow_critic_rate", "search_policy_weight", "search_value_weight", "model_learning_rate",
    "actor_learning_rate", "value_learning_rate", "adam_beta1", "adam_beta2", "adam_epsilon",
    "gradient_clip",
}


class Networks:
    """The layers, over a dictionary of tensors by their exported names."""

    def __init__(self, settings, tensors):
        self.s = settings
        self.p = tensors

    def affine(self, name, x):
        return F.linear(x, self.p[name + ".weight"], self.p[name + ".bias"])

    def hidden(self, name, x):
        y = self.affine(name, x)
        if self.s.norm == "layer":
            y = F.layer_norm(y, y.shape[-1:], self.p[name + ".norm_scale"],
                             self.p[name + ".norm_shift"])
        return F.elu(y)

    def mlp(self, name, layers, x, out=True):
        for i in range(layers):
            x = self.hidden(f"{name}.{i}", x)
        return self.affine(name + ".out", x) if out else x

    # World model.
    def encode(self, o):
        return self.mlp("encoder", self.s.encoder_layers, o, out=False)

    def recur(self, z, h, a):
        x = self.hidden("recurrence", torch.cat([z, a], -1))
        return torch.gru_cell(x, h, self.p["gru.input.weight"], self.p["gru.recurrent.weight"],
                              self.p["gru.input.bias"], self.p["gru.recurrent.bias"])

    def gaussian(self, raw):
        mean, c = raw.chunk(2, -1)
        return Normal(mean, softplus(c) + self.s.min_std)

    def prior(self, h):
        return self.gaussian(self.mlp("prior", 1, h))

    def posterior(self, h, e):
        return self.gaussian(self.mlp("posterior", 1, torch.cat([h, e], -1)))

    def observation(self, state):
        return self.mlp("observation", self.s.decoder_layers, state)

    def reward(self, state):
        return self.mlp("reward", self.s.reward_layers, state).squeeze(-1)

    def continuation_logit(self, state):
        return self.mlp("continuation", self.s.continuation_layers, state).squeeze(-1)

    # Behaviour.
    def actor(self, state):
        """The Gaussian whose draws go through tanh."""
        m, c = self.mlp("actor", self.s.actor_layers, state).chunk(2, -1)
        limit = self.s.actor_mean_limit
        std = softplus(c + math.log(math.exp(self.s.actor_initial_std) - 1))
        return Normal(limit * torch.tanh(m / limit), std + self.s.actor_min_std)

    def value(self, state):
        return self.s.value_scale * self.mlp("value", self.s.value_layers, state).squeeze(-1)


def softplus(x):
    return F.softplus(x, threshold=600)  # torch's default is linear beyond 20


def detach(normal):
    return Normal(normal.mean.detach(), normal.stddev.detach())


def kl(q, p):
    return kl_divergence(Independent(q, 1), Independent(p, 1))


def log_density(normal, u):
    """ln p(tanh u), u drawn from the Gaussian: ln(1 - tanh(u)^2) = -2 ln cosh u."""
    log_cosh = u.abs() + torch.log1p(torch.exp(-2 * u.abs())) - math.log(2)
    return (normal.log_prob(u) + 2 * log_cosh).sum(-1)


def lambda_returns(s, rewards, discounts, values):
    """V_0 .. V_{H-1} as the lambda-weighted mean of the n-step returns.

    rewards, discounts: [H, K], on arriving at s_1 .. s_H. values: [H + 1, K].
    """
    mix = s.lambda_mix
    horizon = len(rewards)
    returns = []
    for tau in range(horizon):
        total, gained, through = 0, 0, 1
        steps = horizon - tau
        for n in range(1, steps + 1):
            gained = gained + through * rewards[tau + n - 1]
            through = through * discounts[tau + n - 1]
            weight = mix ** (n - 1) * ((1 - mix) if n < steps else 1)
            total = total + weight * (gained + through * values[tau + n])
        returns.append(total)
    return torch.stack(returns)


class Agent(GoldenAgent):
    def __init__(self, data):
        super().__init__(data, SETTINGS)
        s = self.s
        s.lambda_mix = getattr(s, "lambda")
        self.slow = {n: torch.tensor(v) for n, v in data["slow"].items()}
        self.nets = Networks(s, self.weights)
        self.groups = {
            "model": [n for n in self.weights if not n.startswith(("actor.", "value."))],
            "actor": [n for n in self.weights if n.startswith("actor.")],
            "value": [n for n in self.weights if n.startswith("value.")],
        }
        self.optimisers = {
            group: torch.optim.Adam([self.weights[n] for n in names],
                                    lr=getattr(s, group + "_learning_rate"),
                                    betas=(s.adam_beta1, s.adam_beta2), eps=s.adam_epsilon)
            for group, names in self.groups.items()
        }

    def fit(self, update, report):
        s, nets = self.s, self.nets
        b, t = update["sequences"], update["length"]

        def sequence(name, *shape):  # rows are sequence by sequence
            values = torch.as_tensor(update[name], dtype=torch.get_default_dtype())
            return values.reshape(b, t, *shape).transpose(0, 1)

        raw = sequence("observations", self.o)
        observations = self.standardise(raw)
        actions, rewards = sequence("actions", self.a), sequence("rewards")
        noise = torch.as_tensor(update["posterior_noise"]).reshape(t, b, s.stochastic)
        embedding = nets.encode(observations)
        z, h = torch.zeros(b, s.stochastic), torch.zeros(b, s.deterministic)
        states, q_mean, q_std = [], [], []
        for step in range(t):
            h = nets.recur(z, h, actions[step])
            q = nets.posterior(h, embedding[step])
            z = q.mean + q.stddev * noise[step]
            states.append(torch.cat([z, h], -1))
            q_mean.append(q.mean)
            q_std.append(q.stddev)
        states = torch.stack(states)
        q = Normal(torch.stack(q_mean), torch.stack(q_std))
        p = nets.prior(states[..., s.stochastic:])

        observation = (0.5 * (nets.observation(states) - observations) ** 2).sum(-1).mean()
        reward = (0.5 * (nets.reward(states) - rewards) ** 2).mean()
        loss = s.observation_weight * observation + s.reward_weight * reward
        continuation = torch.zeros(())
        if s.continuation:
            target = s.discount * sequence("discounts")
            continuation = F.binary_cross_entropy_with_logits(nets.continuation_logit(states),
                                                              target)
            loss = loss + s.continuation_scale * continuation

        def charged(divergence):
            if s.free_nats_over == "batch":
                return divergence.mean().clamp(min=s.free_nats)
            return divergence.clamp(min=s.free_nats).mean()

        divergence = kl(q, p)
        value = loss + s.kl_scale * charged(divergence)
        # The factors weigh the two halves of the gradient, not the loss.
        loss = loss + s.kl_scale * (s.kl_prior_factor * charged(kl(detach(q), p)) +
                                    s.kl_posterior_factor * charged(kl(q, detach(p))))
        report["losses"].update(observation_loss=observation, reward_loss=reward,
                                continuation_loss=continuation, kl=divergence.mean(),
                                model_loss=value, prior_std=p.stddev.mean(),
                                posterior_std=q.stddev.mean())
        report["posterior_states"] = states.reshape(t * b, -1)
        report["covers"] = {
            "steps above free nats": f"{int((divergence > s.free_nats).sum())} of {t * b}",
            "mean divergence above": bool(divergence.mean() > s.free_nats),
            "observations clipped": int((observations.abs() == s.observation_clip).sum()),
        }
        return states.reshape(t * b, -1).detach(), loss

    def dream(self, update, posterior, report):
        s, nets = self.s, self.nets
        state = posterior[update["starts"]]
        count = len(state)
        latent_noise = torch.as_tensor(update["latent_noise"]).reshape(s.horizon, count, -1)
        action_noise = torch.as_tensor(update["action_noise"]).reshape(s.horizon, count, -1)
        states, entropies, deviations = [state], [], []
        for tau in range(s.horizon):
            policy = nets.actor(state.detach())
            u = policy.mean + policy.stddev * action_noise[tau]
            entropies.append(-log_density(policy, u))
            deviations.append(policy.stddev)
            z, h = state[:, :s.stochastic], state[:, s.stochastic:]
            h = nets.recur(z, h, torch.tanh(u))
            prior = nets.prior(h)
            state = torch.cat([prior.mean + prior.stddev * latent_noise[tau], h], -1)
            states.append(state)
        states, entropy = torch.stack(states), torch.stack(entropies)
        arrived, left = states[1:], states[:-1]
        if s.continuation:
            discounts = torch.sigmoid(nets.continuation_logit(arrived))
        else:
            discounts = torch.full((s.horizon, count), s.discount)
        returns = lambda_returns(s, nets.reward(arrived), discounts, nets.value(states))
        weights = torch.cat([torch.ones(1, count), discounts[:-1]]).cumprod(0).detach()
        scale = 1.0
        if s.return_scale == "percentile" and self.range is not None:
            scale = max(1.0, self.range)
        gains = weights * (returns / scale + s.entropy_scale * entropy)
        searches = Searches(update, self.a).at(update["starts"])
        nll = searches.nll(nets.actor(states[0].detach()))
        actor = -gains.mean() + s.search_policy_weight * nll.mean()

        # The critic, in units of value_scale; its slow copy is a second target.
        values = nets.value(left.detach())
        slow = Networks(s, self.slow).value(left.detach())
        targets = returns.detach().clone()
        targets[0] = searches.mix(s.search_value_weight, targets[0])
        error = (values - targets) / s.value_scale
        drift = (values - slow) / s.value_scale
        value = (weights * 0.5 * (error ** 2 + s.slow_critic_weight * drift ** 2)).mean()

        if s.return_scale == "percentile":
            self.follow_range(returns.detach().flatten())
        report["losses"].update(actor_loss=actor, value_loss=value,
                                imagined_return=returns[0].mean(), value_mean=values.mean(),
                                actor_entropy=entropy.mean(),
                                actor_std=torch.stack(deviations).mean(),
                                imitation_loss=nll.mean() / searches.made.mean().clamp(min=1e-9),
                                searched=searches.made.mean())
        # Means of terms of either sign may nearly cancel: the terms' mean size.
        report["scales"] = {"actor_loss": gains.abs().mean() +
                            s.search_policy_weight * nll.abs().mean(),
                            "imitation_loss": nll.abs().mean() /
                            searches.made.mean().clamp(min=1e-9),
                            "imagined_return": returns[0].abs().mean(),
                            "value_mean": values.abs().mean(),
                            "actor_entropy": entropy.abs().mean()}
        size = s.stochastic + s.deterministic
        report.update(dream_states=left.reshape(-1, size), dream_weights=weights.flatten(),
                      returns=returns.flatten())
        report["covers"]["return scale"] = scale
        report["covers"]["starts searched"] = int(searches.made.sum())
        return actor, value

    def update(self, update):
        s = self.s
        report = {"losses": {}}
        posterior, model = self.fit(update, report)
        actor, value = self.dream(update, posterior, report)
        gradients = self.descend({"model": model, "actor": actor, "value": value}, report)
        if s.slow_critic_weight > 0:
            for name, slow in self.slow.items():
                slow += s.slow_critic_rate * (self.weights[name].detach() - slow)
        return report, gradients


if __name__ == "__main__":
    remake(Agent, "slow")
