"""A window that shows frames, for `render_mode="human"`; needs the extra `[human]`."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled

from tdac_envs.core.extras import install_command
from tdac_envs.drawing.canvas import Image


class Window:
    """A pygame window, which opens with the first frame and has its size.

    Closing it by hand acts like Ctrl-C: the next `show` raises `KeyboardInterrupt`.

    Args:
        title: Text of the title bar.
        fps: Frame rate of `show`, frames per second.

    Raises:
        DependencyNotInstalled: pygame is missing.
    """

    def __init__(self, title: str, fps: float) -> None:
        try:
            import pygame
        except ImportError as error:
            raise DependencyNotInstalled(
                f'render_mode="human" needs pygame: {install_command("human")}'
            ) from error
        self._pygame: Any = pygame
        self._title, self._fps = title, fps
        self._screen: Any = None
        self._clock: Any = None

    def show(self, frame: Image) -> None:
        """Shows a frame and waits until the next one is due.

        Args:
            frame: Shape (height, width, 3), uint8 RGB.
        """
        pygame = self._pygame
        size = (frame.shape[1], frame.shape[0])
        if self._screen is None or self._screen.get_size() != size:
            pygame.display.init()
            self._screen = pygame.display.set_mode(size)
            pygame.display.set_caption(self._title)
            self._clock = pygame.time.Clock()
        pygame.surfarray.blit_array(self._screen, np.swapaxes(frame, 0, 1))
        pygame.display.flip()
        self._clock.tick(self._fps)
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            raise KeyboardInterrupt

    def close(self) -> None:
        """Closes the window, if it is open."""
        if self._screen is not None:
            self._screen = None
            self._pygame.display.quit()
