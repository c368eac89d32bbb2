"""What Kornia's augmentations make of one drawn image on given parameters: `input.npy`, `outputs.npy`.

    pip install kornia==0.8.1 torch numpy
    python data/golden/kornia/make.py

Every case goes through the augmentation's own `forward` with parameters in place of drawn ones, in f32;
results are rounded to bytes once. Kornia 0.9 samples `RandomPerspective` otherwise: up to 0.8 everything is
stretched by `width / (width - 1)` and moved by half a pixel. The cases stand in the same order in `crates/rsf/tests/kornia_golden.rs`.
"""

from pathlib import Path

import kornia.augmentation as K
import numpy as np
import torch

HERE = Path(__file__).parent
HEIGHT, WIDTH = 36, 48


def drawn() -> np.ndarray:
    """Ramps, a checkerboard, a disk and a dark corner; no photograph."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    image = np.stack([5 * x, 6 * y, 3 * (x + y)], axis=-1).astype(np.float64)
    image[(x // 6 + y // 6) % 2 == 0] *= 0.6
    image[(x - 30) ** 2 + (y - 14) ** 2 < 64] = (220, 90, 40)
    image[28:, :12] = (14, 22, 30)
    noise = np.random.default_rng(4).integers(-9, 10, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8)


def corners(points) -> torch.Tensor:
    return torch.tensor([points], dtype=torch.float32)


FRAME = [[0, 0], [WIDTH - 1, 0], [WIDTH - 1, HEIGHT - 1], [0, HEIGHT - 1]]


def one(value, dtype=torch.float32) -> torch.Tensor:
    return torch.tensor([value], dtype=dtype)


def jiggle(brightness, contrast, saturation, hue, order):
    given = {
        "brightness_factor": one(brightness),
        "contrast_factor": one(contrast),
        "saturation_factor": one(saturation),
        "hue_factor": one(hue),
        "order": torch.tensor(order),
    }
    return K.ColorJiggle(0.1, 0.1, 0.1, 0.1, p=1.0), given


def affine(translation, scale, degrees, shear):
    given = {
        "translations": one(translation),
        "center": one([WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5]),
        "scale": one(scale),
        "angle": one(degrees),
        "shear_x": one(shear[0]),
        "shear_y": one(shear[1]),
    }
    return K.RandomAffine(10.0, (0.1, 0.1), (0.9, 1.1), (5.0, 5.0), p=1.0), given


def crop(left, top, width, height):
    right, bottom = left + width - 1, top + height - 1
    given = {
        "src": corners([[left, top], [right, top], [right, bottom], [left, bottom]]),
        "dst": corners(FRAME),
        "input_size": torch.tensor([[HEIGHT, WIDTH]]),
        "output_size": torch.tensor([[HEIGHT, WIDTH]]),
    }
    return K.RandomResizedCrop((HEIGHT, WIDTH), p=1.0), given


def erasing(left, top, width, height, value):
    given = {"widths": one(width), "heights": one(height), "xs": one(left), "ys": one(top), "values": one(value)}
    return K.RandomErasing(p=1.0, value=value), given


def motion(kernel, degrees, direction):
    given = {
        "ksize_factor": one(kernel, torch.int32),
        "angle_factor": one(degrees),
        "direction_factor": one(direction),
        "idx": torch.tensor([0]),
    }
    return K.RandomMotionBlur((kernel, kernel), 35.0, 0.5, p=1.0), given


CASES = [
    (K.RandomPerspective(0.5, p=1.0), {"start_points": corners(FRAME), "end_points": corners([[3, 2], [43, 4], [45, 31], [1, 34]])}),
    (K.RandomPerspective(0.5, p=1.0), {"start_points": corners(FRAME), "end_points": corners([[8, 0], [47, 5], [40, 35], [0, 30]])}),
    affine([2.5, -1.25], [1.1, 1.1], 4.0, [3.0, 0.0]),
    affine([-3.0, 2.0], [0.93, 0.93], -5.0, [-4.0, 2.0]),
    (K.RandomRotation(30.0, p=1.0), {"degrees": one(17.0)}),
    (K.RandomRotation(30.0, p=1.0), {"degrees": one(-8.5)}),
    crop(5, 3, 38, 29),
    crop(0, 8, 41, 27),
    (K.RandomHorizontalFlip(p=1.0), {}),
    jiggle(1.2, 0.8, 1.3, 0.04, [0, 1, 2, 3]),
    jiggle(0.8, 1.3, 0.5, -0.05, [2, 0, 3, 1]),
    (K.RandomGrayscale(p=1.0), {}),
    (K.RandomGamma(p=1.0), {"gamma_factor": one(1.6), "gain_factor": one(0.95)}),
    (K.RandomGamma(p=1.0), {"gamma_factor": one(0.7), "gain_factor": one(1.08)}),
    (K.RandomPosterize(3, p=1.0), {"bits_factor": one(3, torch.int32)}),
    (K.RandomEqualize(p=1.0), {}),
    (K.RandomGaussianBlur((5, 5), (0.3, 1.5), p=1.0), {"sigma": one(0.4)}),
    (K.RandomGaussianBlur((5, 5), (0.3, 1.5), p=1.0), {"sigma": one(1.3)}),
    motion(5, 20.0, 0.3),
    motion(7, -30.0, -0.5),
    erasing(7, 5, 12, 9, 0.4),
    (K.RandomSnow((0.3, 0.7), (1.3, 3.0), p=1.0), {"snow_coefficient": one(0.5), "brightness": one(2.0)}),
    (K.RandomSnow((0.3, 0.7), (1.3, 3.0), p=1.0), {"snow_coefficient": one(0.65), "brightness": one(1.4)}),
]


def run(augmentation, given, image) -> np.ndarray:
    torch.manual_seed(0)
    drawn = augmentation.forward_parameters(image.shape)
    unknown = [name for name in given if name not in drawn]
    assert not unknown, (type(augmentation).__name__, unknown, list(drawn))
    for name, value in given.items():
        assert drawn[name].shape == value.shape, (type(augmentation).__name__, name, drawn[name], value)
        drawn[name] = value.to(drawn[name].dtype)
    result = augmentation(image, params=drawn)
    return (255 * result[0].permute(1, 2, 0).numpy()).round().clip(0, 255).astype(np.uint8)


def main() -> None:
    pixels = drawn()
    image = torch.from_numpy(pixels).permute(2, 0, 1)[None].float() / 255
    np.save(HERE / "input.npy", pixels)
    np.save(HERE / "outputs.npy", np.stack([run(*case, image) for case in CASES]))


if __name__ == "__main__":
    main()
