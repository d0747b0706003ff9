"""Contents of leaves from their spectra, `btf.leaf.invert`."""

import unittest

import btf
import numpy as np
from refusals import Refusing

#: PROSPECT-D by the Python package prosail 2.0.5, which shares no code with this project.
CONTENTS = {
    "chlorophyll_ug_per_cm2": 43.0,
    "carotenoid_ug_per_cm2": 9.5,
    "anthocyanin_ug_per_cm2": 1.5,
    "brown": 0.05,
    "water_cm": 0.013,
    "dry_matter_g_per_cm2": 0.0062,
    "structure": 1.7,
}
WAVELENGTHS_NM = np.array([*range(400, 800, 20), *range(800, 2501, 100)], float)
REFLECTANCE = np.array([
    0.043147, 0.042095, 0.041413, 0.041584, 0.042089, 0.048830, 0.094662, 0.131101, 0.127532, 0.094693, 0.080671,
    0.065096, 0.056271, 0.041680, 0.036366, 0.135308, 0.327175, 0.437270, 0.467977, 0.481083, 0.482398, 0.483875,
    0.474726, 0.476937, 0.448737, 0.440146, 0.239526, 0.210758, 0.319764, 0.324678, 0.289704, 0.045269, 0.065473,
    0.136402, 0.173901, 0.126935, 0.076894, 0.033570,
])
TRANSMITTANCE = np.array([
    0.000180, 0.000257, 0.000249, 0.001554, 0.002864, 0.011861, 0.059047, 0.094983, 0.093846, 0.064399, 0.051981,
    0.036830, 0.027772, 0.010551, 0.003198, 0.109655, 0.295858, 0.404343, 0.436026, 0.449603, 0.450524, 0.452532,
    0.447226, 0.457061, 0.437577, 0.437151, 0.241400, 0.219522, 0.345972, 0.363643, 0.334629, 0.043900, 0.075495,
    0.174254, 0.229504, 0.176839, 0.110624, 0.039523,
])


class Inversion(Refusing):
    def test_a_leaf_of_another_implementation_is_found(self):
        found = btf.leaf.invert(WAVELENGTHS_NM, REFLECTANCE, TRANSMITTANCE)
        self.assertEqual(found["unknowns"], list(CONTENTS))
        for key, value in CONTENTS.items():
            self.assertEqual(found[key].shape, (1,))
            np.testing.assert_allclose(found[key], value, rtol=2e-3, err_msg=key)
            self.assertEqual(found[key + "_state"], ["found"])
        self.assertLess(found["rmse_reflectance"][0], 1e-5)
        self.assertEqual(found["correlations"].shape, (1, 7, 7))
        np.testing.assert_allclose(np.diagonal(found["correlations"][0]), 1.0)
        # Planted difference: a leaf of less transmittance is not that leaf.
        other = btf.leaf.invert(WAVELENGTHS_NM, REFLECTANCE, 0.9 * TRANSMITTANCE)
        self.assertGreater(abs(other["chlorophyll_ug_per_cm2"][0] - 43.0), 0.5)

    def test_many_leaves_are_those_one_by_one_on_any_number_of_threads(self):
        noise = np.random.default_rng(1).normal(0.0, 0.005, (2, 600, len(WAVELENGTHS_NM)))
        many = btf.leaf.invert(WAVELENGTHS_NM, REFLECTANCE + noise[0], TRANSMITTANCE + noise[1], threads=2)
        for i in (0, 599):
            one = btf.leaf.invert(WAVELENGTHS_NM, REFLECTANCE + noise[0, i], TRANSMITTANCE + noise[1, i], threads=1)
            self.assertEqual(one["water_cm"][0], many["water_cm"][i])
        errors = many["chlorophyll_ug_per_cm2"] - 43.0
        self.assertLess(np.sqrt(np.mean(errors**2)), 2.0)
        told = many["chlorophyll_ug_per_cm2_standard_error"]
        self.assertTrue(0.5 < np.std(errors) / np.median(told) < 2.0)

    def test_values_are_held_and_gaps_are_passed_over(self):
        gappy = REFLECTANCE.copy()
        gappy[5:9] = np.nan
        found = btf.leaf.invert(WAVELENGTHS_NM, gappy, TRANSMITTANCE, held={"brown": 0.05, "structure": 1.7})
        self.assertEqual((found["brown"][0], found["brown_state"]), (0.05, ["held"]))
        np.testing.assert_allclose(found["chlorophyll_ug_per_cm2"], 43.0, rtol=1e-2)
        visible = WAVELENGTHS_NM < 800
        found = btf.leaf.invert(WAVELENGTHS_NM[visible], REFLECTANCE[visible])
        self.assertEqual(found["water_cm_state"], ["untold"])
        self.assertTrue(any("water cannot be told" in remark for remark in found["remarks"][0]))
        self.assertTrue(np.isnan(found["rmse_transmittance"][0]))

    def test_an_algorithmic_model_looks_for_pigments(self):
        visible = WAVELENGTHS_NM < 800
        found = btf.leaf.invert(
            WAVELENGTHS_NM[visible], REFLECTANCE[visible], TRANSMITTANCE[visible], model="abm97", rays=20_000
        )
        self.assertEqual(found["unknowns"], ["chlorophyll_ug_per_cm2", "carotenoid_ug_per_cm2", "rest"])
        self.assertTrue(20.0 < found["chlorophyll_ug_per_cm2"][0] < 90.0)

    def test_both_faces_tell_the_halves(self):
        # Planted difference: a back that is paler in the visible, as leaves have it.
        paler = np.where(WAVELENGTHS_NM < 720, REFLECTANCE + 0.05, REFLECTANCE)
        one, two = [
            btf.leaf.invert(
                WAVELENGTHS_NM, REFLECTANCE, TRANSMITTANCE, abaxial_reflectance=paler, abaxial_transmittance=TRANSMITTANCE,
                model=model,
            )
            for model in ("plate-n", "plate-two-sided")
        ]
        self.assertEqual(two["unknowns"][7:], ["palisade_layers", "palisade_pigments", "palisade_body"])
        self.assertEqual(two["correlations"].shape, (1, 10, 10))
        self.assertLess(2.0 * two["rmse_abaxial_reflectance"][0], one["rmse_abaxial_reflectance"][0])
        self.assertGreater(two["palisade_pigments"][0], two["palisade_layers"][0])
        back = btf.leaf.invert(WAVELENGTHS_NM, paler, model="plate-two-sided", side="abaxial")
        self.assertTrue(any("both faces" in remark for remark in back["remarks"][0]))
        self.assertTrue(np.isnan(back["rmse_reflectance"][0]) and back["rmse_abaxial_reflectance"][0] < 0.03)

    def test_what_does_not_fit_is_refused_in_a_sentence(self):
        invert = btf.leaf.invert
        self.refused(ValueError, "reflectance, transmittance or both", invert, WAVELENGTHS_NM)
        self.refused(ValueError, "38 wavelengths", invert, WAVELENGTHS_NM, REFLECTANCE[:5])
        self.refused(ValueError, "divide percent by 100", invert, WAVELENGTHS_NM, 100 * REFLECTANCE)
        self.refused(ValueError, "do not ascend", invert, WAVELENGTHS_NM[::-1], REFLECTANCE)
        self.refused(ValueError, "'wet'", invert, WAVELENGTHS_NM, REFLECTANCE, held={"wet": 1})
        self.refused(ValueError, "brown", invert, WAVELENGTHS_NM, REFLECTANCE, held={"brown": -1})
        self.refused(ValueError, "'plate-paper'", invert, WAVELENGTHS_NM, REFLECTANCE, model="plate-paper")
        self.refused(ValueError, "'front'", invert, WAVELENGTHS_NM, REFLECTANCE, side="front")
        self.refused(
            ValueError, "leave it out", invert, WAVELENGTHS_NM, REFLECTANCE, abaxial_reflectance=REFLECTANCE, side="abaxial"
        )
        self.refused(ValueError, "rays 0", invert, WAVELENGTHS_NM, REFLECTANCE, rays=0)
        self.refused(ValueError, "NaN where", invert, WAVELENGTHS_NM, REFLECTANCE - 9.999)


if __name__ == "__main__":
    unittest.main()
