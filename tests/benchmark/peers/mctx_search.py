#!/usr/bin/env python3
"""Mctx's searches on a model of the paper's sizes, jitted, timed.

    mctx_search.py

The model is the one that planner_latency.cc gives our planners (24 observations, 6 actions;
sizes and layers below), random weights, float32. Mctx searches over a fixed number of actions,
so each node carries that many drawn from the actor, as in mcts_fixed and mcts_gumbel.
A simulation asks for what ours ask for: a transition, its reward, its value, the actor.

Cases NAME/ROOTS, NAME one of muzero_policy and gumbel_muzero_policy; units are decisions.
"""
import math
import sys

from turns import serve

ACTION_SIZE = 6
DETERMINISTIC, STOCHASTIC, HIDDEN = 200, 30, 200
REWARD_LAYERS, VALUE_LAYERS, ACTOR_LAYERS = 2, 3, 4
SIMULATIONS = 50
# Actions at a node: the defaults of mcts_fixed and of mcts_gumbel.
CHILDREN = {"muzero_policy": 20, "gumbel_muzero_policy": 16}
ROOTS = (1, 64)


def prepare():
    import jax
    import jaxlib
    import mctx
    import numpy
    from jax import numpy as jnp

    if jax.default_backend() != "cpu":
        raise RuntimeError(f"JAX runs on {jax.default_backend()}, not on the CPU")
    random = numpy.random.default_rng(1)

    def dense(inputs, outputs):
        weight = random.normal(size=(inputs, outputs)) / math.sqrt(inputs)
        return {"w": jnp.asarray(weight, jnp.float32), "b": jnp.zeros(outputs, jnp.float32)}

    def mlp(inputs, layers, outputs):
        sizes = [inputs] + [HIDDEN] * layers + [outputs]
        return [dense(i, o) for i, o in zip(sizes, sizes[1:])]

    state = STOCHASTIC + DETERMINISTIC
    weights = {
        "recurrence": dense(STOCHASTIC + ACTION_SIZE, HIDDEN),
        "gru_input": dense(HIDDEN, 3 * DETERMINISTIC),
        "gru_recurrent": dense(DETERMINISTIC, 3 * DETERMINISTIC),
        "prior": mlp(DETERMINISTIC, 1, 2 * STOCHASTIC),
        "reward": mlp(state, REWARD_LAYERS, 1),
        "value": mlp(state, VALUE_LAYERS, 1),
        "actor": mlp(state, ACTOR_LAYERS, 2 * ACTION_SIZE),
    }

    def affine(layer, x):
        return x @ layer["w"] + layer["b"]

    def network(layers, x):
        for layer in layers[:-1]:
            x = jax.nn.elu(affine(layer, x))
        return affine(layers[-1], x)

    def transition(p, key, z, h, action):
        x = jax.nn.elu(affine(p["recurrence"], jnp.concatenate([z, action], -1)))
        xr, xu, xn = jnp.split(affine(p["gru_input"], x), 3, -1)
        hr, hu, hn = jnp.split(affine(p["gru_recurrent"], h), 3, -1)
        update = jax.nn.sigmoid(xu + hu)
        h = (1 - update) * jnp.tanh(xn + jax.nn.sigmoid(xr + hr) * hn) + update * h
        mean, raw = jnp.split(network(p["prior"], h), 2, -1)
        return mean + jax.nn.softplus(raw) * jax.random.normal(key, mean.shape), h

    def look(p, key, z, h, children):
        """The value and the actor's draws at a state."""
        s = jnp.concatenate([z, h], -1)
        mean, raw = jnp.split(network(p["actor"], s)[:, None], 2, -1)
        noise = jax.random.normal(key, (len(z), children, ACTION_SIZE))
        actions = jnp.tanh(mean + jax.nn.softplus(raw) * noise)
        return s, network(p["value"], s)[:, 0], actions

    def search(name, roots):
        children = CHILDREN[name]

        def recurrent(p, key, index, latent):
            key_z, key_a = jax.random.split(key)
            action = jnp.take_along_axis(latent["actions"], index[:, None, None], 1)[:, 0]
            z, h = transition(p, key_z, latent["z"], latent["h"], action)
            s, value, actions = look(p, key_a, z, h, children)
            reward = network(p["reward"], s)[:, 0]
            output = mctx.RecurrentFnOutput(
                reward=reward, discount=jnp.full(reward.shape, 0.99), value=value,
                prior_logits=jnp.zeros((len(z), children)))
            return output, {"z": z, "h": h, "actions": actions}

        def decide(p, key, z, h):
            key, key_a = jax.random.split(key)
            _, value, actions = look(p, key_a, z, h, children)
            root = mctx.RootFnOutput(prior_logits=jnp.zeros((len(z), children)), value=value,
                                     embedding={"z": z, "h": h, "actions": actions})
            options = {}
            if name == "gumbel_muzero_policy":
                options["max_num_considered_actions"] = children
            output = getattr(mctx, name)(p, key, root, recurrent, num_simulations=SIMULATIONS,
                                         **options)
            return jnp.take_along_axis(actions, output.action[:, None, None], 1)[:, 0]

        jitted = jax.jit(decide)
        z = jnp.asarray(random.normal(size=(roots, STOCHASTIC)), jnp.float32)
        h = jnp.asarray(numpy.tanh(random.normal(size=(roots, DETERMINISTIC))), jnp.float32)
        seeds = iter(range(1 << 62))

        def run():
            jitted(weights, jax.random.PRNGKey(next(seeds)), z, h).block_until_ready()

        return run, roots

    cases = {f"{name}/{roots}": search(name, roots) for name in CHILDREN for roots in ROOTS}
    return {"Mctx": mctx.__version__, "JAX": jax.__version__, "jaxlib": jaxlib.__version__}, cases


if __name__ == "__main__":
    if len(sys.argv) != 1:
        raise SystemExit(__doc__)
    serve(prepare)
