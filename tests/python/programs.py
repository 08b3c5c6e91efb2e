"""runner and results, called in one folder."""
import subprocess


class Programs:
    def __init__(self, binaries, folder):
        self.binaries, self.folder = binaries, folder

    def call(self, program, *words):
        done = subprocess.run([self.binaries / program, *words], cwd=self.folder,
                              capture_output=True, text=True)
        assert done.returncode == 0, (program, words, done.stderr[-2000:])
        return done.stdout
