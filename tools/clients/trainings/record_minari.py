"""Minari: records three episodes as a data set and reads it."""

import os
import tempfile

import gymnasium as gym

STEPS = 40


def main():
    """Records and reads the data set; prints its numbers of episodes and steps."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MINARI_DATASETS_PATH"] = folder
        import minari

        import tdac_envs  # noqa: F401 - registers the environments

        made = gym.make("TDAC-Map2D-v0", horizon=STEPS)
        env = minari.DataCollector(made, record_infos=True)
        for seed in range(3):
            env.reset(seed=seed)
            over = False
            while not over:
                _, _, terminated, truncated, _ = env.step(env.action_space.sample())
                over = terminated or truncated
        env.create_dataset("tdac/maze-v0", algorithm_name="random")
        env.close()
        found = minari.load_dataset("tdac/maze-v0")
        again = found.recover_environment()
        assert again.observation_space == made.observation_space
        print(f"{found.total_episodes} episodes, {found.total_steps} steps")


if __name__ == "__main__":
    main()
