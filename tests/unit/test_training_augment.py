"""Laws of the batch's way to the network."""

import numpy as np
import pytest
import torch

from deeplight.preprocess import normalise
from deeplight.training.augment import AugmentConfig, augment, prepare, turn_back


@pytest.fixture
def inputs():
    random = np.random.default_rng(0)
    photo = random.integers(0, 256, (16, 12, 10, 3), dtype=np.uint8)
    spheres = random.integers(0, 256, (16, 3, 8, 8, 3), dtype=np.uint8)
    return prepare(torch.from_numpy(photo), torch.from_numpy(spheres), torch.zeros(16).long())


def test_prepare_is_preprocess_normalise():
    photo = np.random.default_rng(0).integers(0, 256, (2, 192, 135, 3), dtype=np.uint8)
    ours = prepare(
        torch.from_numpy(photo),
        torch.zeros(2, 3, 8, 8, 3, dtype=torch.uint8),
        torch.zeros(2).long(),
    ).photo
    np.testing.assert_allclose(ours.numpy(), normalise(photo), atol=1e-7)
    assert ours.min() >= -0.5
    assert ours.max() <= 0.5


def test_prepare_keeps_rows_columns_and_channels_of_spheres():
    spheres = torch.randint(0, 256, (1, 3, 8, 8, 3), dtype=torch.uint8)
    ours = prepare(torch.zeros(1, 4, 4, 3, dtype=torch.uint8), spheres, torch.zeros(1).long())
    assert ours.spheres[0, 2, 1, 8 * 5 + 6].item() == pytest.approx(spheres[0, 2, 5, 6, 1] / 255)


def test_flipping_marks_what_it_flips(inputs):
    torch.manual_seed(0)
    new = augment(inputs, AugmentConfig())
    assert 0 < new.flipped.sum() < 16
    torch.testing.assert_close(turn_back(new.photo, new.flipped), inputs.photo)
    torch.testing.assert_close(new.spheres, inputs.spheres)


def test_nothing_is_changed_when_all_is_off(inputs):
    new = augment(inputs, AugmentConfig(flip=False))
    torch.testing.assert_close(new.photo, inputs.photo)
    assert not new.flipped.any()


def test_the_same_seed_gives_the_same_batch(inputs):
    everything = AugmentConfig(cutout=0.5, noise=0.02, exposure_stops=0.5, white_balance=0.1)
    batches = []
    for seed in (5, 5, 6):
        torch.manual_seed(seed)
        batches.append(augment(inputs, everything))
    assert torch.equal(batches[0].photo, batches[1].photo)
    assert torch.equal(batches[0].spheres, batches[1].spheres)
    assert not torch.equal(batches[0].photo, batches[2].photo)


def test_cutout_hides_no_more_than_it_may(inputs):
    torch.manual_seed(0)
    new = augment(inputs, AugmentConfig(flip=False, cutout=0.5))
    hidden = ((new.photo == 0) & (inputs.photo != 0)).any(1).float().mean((1, 2))
    assert hidden.max() <= 0.5**2 * 1.4  # whole pixels of a 12 x 10 photo
    assert hidden.max() > 0


def test_exposure_changes_photo_and_spheres_alike_and_clips_at_white():
    grey = torch.full((8, 4, 4, 3), 128, dtype=torch.uint8)
    inputs = prepare(
        grey, torch.full((8, 3, 4, 4, 3), 128, dtype=torch.uint8), torch.zeros(8).long()
    )
    torch.manual_seed(0)
    new = augment(inputs, AugmentConfig(flip=False, exposure_stops=3.0))
    torch.testing.assert_close(new.photo[:, :, 0, 0] + 0.5, new.spheres[:, 0, :, 0])
    assert new.photo.max() <= 0.5
    assert len(new.photo[:, 0, 0, 0].unique()) > 2


def test_shuffled_channels_are_those_of_the_example_in_photo_and_spheres_alike(inputs):
    torch.manual_seed(0)
    new = augment(inputs, AugmentConfig(flip=False, channel_shuffle=1.0))
    changed = 0
    for photo, spheres, old_photo, old_spheres in zip(
        new.photo, new.spheres, inputs.photo, inputs.spheres, strict=True
    ):
        order = [int(torch.all(old_photo == channel, dim=(1, 2)).nonzero()[0]) for channel in photo]
        assert sorted(order) == [0, 1, 2]
        torch.testing.assert_close(spheres, old_spheres[:, order])
        changed += order != [0, 1, 2]
    assert 8 <= changed <= 16  # one in six orders is the old one
    some = augment(inputs, AugmentConfig(flip=False, channel_shuffle=0.3))
    assert (some.photo == inputs.photo).flatten(1).all(1).sum() >= 6
