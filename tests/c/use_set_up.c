/* Texts, profiles, codec, estimators and wrong arguments, from C. */
#include <string.h>

#include "program.h"

const tm485_estimator_gains kGains = {
    .period = 62500,
    .order = 3,
    .longest_gap = 32,
    .gain_position = 0.37690419F,
    .gain_velocity = 0.0887343287F,
    .gain_acceleration = 0.010445334F,
    .covariance_pp = 0.0314086825F,
    .covariance_pv = 0.00739452709F,
    .covariance_pa = 0.000870444521F,
    .covariance_vv = 0.00284363399F,
    .covariance_va = 0.000465759396F,
    .covariance_aa = 0.000116663068F,
    .process_noise = 1.45917911e-05F,
    .measurement_variance = 0.0833333358F,
};

int use_texts(void) {
  int major_number = -1;
  unsigned code;
  CHECK(strcmp(tm485_version(&major_number, NULL, NULL), TM485_VERSION_STRING) == 0);
  CHECK(major_number == TM485_VERSION_MAJOR);
  CHECK(tm485_abi() == TM485_ABI);
  CHECK(strcmp(tm485_errc_name(TM485_ERR_CRC_ERROR), "crc_error") == 0);
  CHECK(strcmp(tm485_errc_name(TM485_ERRC_COUNT), "bad_argument") == 0);
  for (code = 0; code < TM485_ERRC_COUNT; ++code) {
    CHECK(strlen(tm485_errc_name((tm485_errc)code)) > 1);
    CHECK(code == 0 || strlen(tm485_errc_cause((tm485_errc)code)) > 5);
    CHECK(code == 0 || strlen(tm485_errc_remedy((tm485_errc)code)) > 5);
  }
  CHECK(strcmp(tm485_status_name(13), "multi_turn_error") == 0);
  CHECK(strcmp(tm485_status_field(13), "ALMC.5") == 0);
  CHECK(strlen(tm485_status_cause(13)) > 5 && strlen(tm485_status_remedy(13)) > 5);
  CHECK(tm485_profile_size() <= sizeof(tm485_profile) && tm485_bus_size() <= sizeof(tm485_bus));
  CHECK(tm485_axis_size() <= sizeof(tm485_axis) && tm485_eeprom_size() <= sizeof(tm485_eeprom));
  CHECK(tm485_reset_size() <= sizeof(tm485_reset) && tm485_estimator_size() <= sizeof(tm485_estimator));
  CHECK(tm485_fixed_estimator_size() <= sizeof(tm485_fixed_estimator));
  return 0;
}

int use_profiles(void) {
  static tm485_profile profile;
  tm485_profile_settings settings;
  tm485_profile_settings back;
  tm485_profile_error why;
  tm485_axis_config axis;
  double degrees;
  size_t i;
  CHECK(tm485_preset_count() >= 10 && tm485_preset_name(tm485_preset_count()) == NULL);
  for (i = 0; i < tm485_preset_count(); ++i) {
    const char* const name = tm485_preset_name(i);
    CHECK(tm485_profile_settings_get(&settings, name) == TM485_OK && strcmp(settings.name, name) == 0);
    CHECK(tm485_profile_compile(&profile, &settings, &why) == TM485_OK && why.field[0] == '\0');
    tm485_profile_settings_of(&back, &profile);
    CHECK(memcmp(&settings, &back, sizeof back) == 0);
    CHECK(tm485_profile_t1(&profile, TM485_ID_EVERYTHING) == settings.t1[3]);
    CHECK(tm485_profile_t1(&profile, 5) == 0 && tm485_profile_exchange_max(&profile, 255) == 0);
    CHECK(tm485_profile_exchange_max(&profile, TM485_ID_EVERYTHING) == TM485_US(4) * 12 + settings.t2_max);
  }
  CHECK(tm485_profile_settings_get(&settings, "nonsense") == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_profile_settings_get(&settings, "tm485_23") == TM485_OK);
  settings.name = NULL;
  settings.t1[3] = TM485_US(20);
  CHECK(tm485_profile_compile(&profile, &settings, &why) == TM485_ERR_BAD_PROFILE);
  CHECK(strcmp(why.field, "t1") == 0 && strcmp(why.why, "shorter than the exchange itself") == 0);
  tm485_profile_settings_of(&back, &profile); /* what was there before */
  CHECK(strcmp(back.name, "any") == 0);
  settings.t1[3] = TM485_US(80);
  CHECK(tm485_profile_compile(&profile, &settings, NULL) == TM485_OK);
  CHECK(tm485_profile_t1(&profile, TM485_ID_EVERYTHING) == TM485_US(80));
  tm485_profile_settings_of(&back, &profile);
  CHECK(strcmp(back.name, "custom") == 0 && back.single_turn_bits == 23);

  tm485_axis_config_default(&axis);
  axis.units = TM485_UNITS_DEG;
  axis.gear_denominator = 2;
  degrees = tm485_to_units(131072, &axis, 17);
  CHECK(degrees > 179.999 && degrees < 180.001);
  return 0;
}

int use_codec(void) {
  static const uint8_t ids[TM485_DATA_ID_COUNT] = {0x0, 0x1, 0x2, 0x3, 0x6, 0x7, 0x8, 0xC, 0xD};
  static const uint8_t cfs[TM485_DATA_ID_COUNT] = {0x02, 0x8A, 0x92, 0x1A, 0x32, 0xBA, 0xC2, 0x62, 0xEA};
  /* ID3: SF 20, ABS 0x1ABCD, ENID 11, ABM FFFE (turn -2), ALMC 40 */
  uint8_t everything[11] = {0x1A, 0x20, 0xCD, 0xAB, 0x01, 0x11, 0xFE, 0xFF, 0x00, 0x40, 0};
  static tm485_profile profile;
  tm485_request request;
  tm485_request parsed;
  tm485_reply reply;
  tm485_data_id id = 0;
  size_t i;
  CHECK(tm485_profile_init(&profile, "tm485_17") == TM485_OK);
  for (i = 0; i < TM485_DATA_ID_COUNT; ++i) {
    CHECK(tm485_control_field(ids[i]) == cfs[i]);
    CHECK(tm485_control_field_parse(&id, cfs[i]) == TM485_OK && id == ids[i]);
    CHECK(tm485_request_length(ids[i]) >= 1 && tm485_reply_length(ids[i]) >= 4);
    if (tm485_request_length(ids[i]) > 1) {
      CHECK(tm485_request_make(&request, ids[i]) == TM485_ERR_BAD_ARGUMENT);
    } else {
      CHECK(tm485_request_make(&request, ids[i]) == TM485_OK);
      CHECK(request.length == 1 && request.bytes[0] == cfs[i] && request.id == ids[i]);
    }
  }
  CHECK(tm485_request_make(&request, 5) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_request_length(5) == 0 && tm485_reply_length(200) == 0);
  CHECK(tm485_control_field_parse(&id, 0x03) == TM485_ERR_CF_SYNC_ERROR);
  CHECK(tm485_control_field_parse(&id, 0x82) == TM485_ERR_CF_PARITY_ERROR);
  CHECK(tm485_request_eeprom_write(&request, 0x12, 0x34) == TM485_OK);
  CHECK(request.length == 4 && request.address == 0x12 && request.data == 0x34);
  CHECK(request.bytes[3] == (0x32 ^ 0x12 ^ 0x34) && tm485_crc(request.bytes, 4) == 0);
  CHECK(tm485_request_parse(&parsed, request.bytes, 4) == TM485_OK);
  CHECK(memcmp(&parsed, &request, sizeof parsed) == 0);
  request.bytes[2] ^= 1U;
  CHECK(tm485_request_parse(&parsed, request.bytes, 4) == TM485_ERR_CRC_ERROR);
  CHECK(tm485_request_parse(&parsed, request.bytes, 3) == TM485_ERR_LENGTH_ERROR);
  CHECK(tm485_request_eeprom_read(&request, 128) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_request_eeprom_read(&request, 127) == TM485_OK && request.length == 3);

  for (i = 0; i < 10; ++i) everything[10] ^= everything[i];
  CHECK(tm485_reply_parse(&reply, everything, 11, TM485_ID_EVERYTHING, &profile) == TM485_OK);
  CHECK(reply.id == TM485_ID_EVERYTHING && reply.abs == 0x1ABCD && reply.abm == 0xFFFE && reply.turns == -2);
  CHECK(reply.sf == 0x20 && reply.almc == 0x40 && reply.enid == 0x11);
  CHECK(reply.has_sf && reply.has_abs && reply.has_abm && reply.has_enid && reply.has_almc &&
        !reply.has_eeprom);
  CHECK(tm485_reply_parse(&reply, everything, 11, TM485_ID_SINGLE_TURN, &profile) == TM485_ERR_LENGTH_ERROR);
  CHECK(tm485_reply_parse(&reply, everything, 11, 4, &profile) == TM485_ERR_BAD_ARGUMENT);
  everything[4] ^= 2U; /* bit 17 of ABS: beyond 17 bit; the CRC follows */
  everything[10] ^= 2U;
  CHECK(tm485_reply_parse(&reply, everything, 11, TM485_ID_EVERYTHING, &profile) ==
        TM485_ERR_ABS_OUT_OF_RANGE);
  CHECK(reply.abs == 0x1ABCD); /* not touched */
  everything[5] ^= 1U;
  CHECK(tm485_reply_parse(&reply, everything, 11, TM485_ID_EVERYTHING, &profile) == TM485_ERR_CRC_ERROR);
  {
    const uint8_t read_back[4] = {0xEA, 0x05, 0xA7, 0xEA ^ 0x05 ^ 0xA7};
    CHECK(tm485_reply_parse(&reply, read_back, 4, TM485_ID_EEPROM_READ, &profile) == TM485_OK);
    CHECK(reply.has_eeprom && reply.eeprom_address == 5 && reply.eeprom_data == 0xA7 && !reply.eeprom_busy);
    CHECK(!reply.has_sf && !reply.has_abs && !reply.has_abm && !reply.has_enid && !reply.has_almc);
  }
  return 0;
}

int use_estimators(tm485_estimate* estimate, tm485_fixed_estimate* fixed_estimate) {
  static tm485_estimator estimator;
  static tm485_fixed_estimator fixed;
  static tm485_fixed_gains fixed_gains;
  tm485_estimator_gains broken = kGains;
  tm485_sample sample;
  int i;
  CHECK(tm485_estimator_gains_valid(&kGains));
  broken.order = 7;
  CHECK(!tm485_estimator_gains_valid(&broken));
  CHECK(tm485_estimator_init(&estimator, &broken) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_fixed_gains_make(&fixed_gains, &broken) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_estimator_init(&estimator, &kGains) == TM485_OK);
  CHECK(tm485_fixed_gains_make(&fixed_gains, &kGains) == TM485_OK);
  CHECK(tm485_fixed_estimator_init(&fixed, &fixed_gains) == TM485_OK);
  tm485_estimator_at(&estimator, 0, estimate);
  CHECK(estimate->state == TM485_ESTIMATOR_EMPTY && !tm485_estimate_valid(estimate));
  memset(&sample, 0, sizeof sample);
  sample.has_position = 1;
  for (i = 0; i < 400; ++i) {
    sample.quality = i % 50 == 49 ? TM485_QUALITY_HELD : TM485_QUALITY_FRESH;
    sample.position = 5000 + 37 * i;
    sample.latch_time = 62500 * (tm485_time)i;
    if (sample.quality == TM485_QUALITY_HELD) {
      CHECK(tm485_estimator_update_sample(&estimator, &sample) == TM485_ESTIMATOR_TRACKING); /* ignored */
      CHECK(tm485_estimator_miss(&estimator, sample.latch_time) == TM485_ESTIMATOR_BRIDGING);
      CHECK(tm485_fixed_estimator_miss(&fixed, sample.latch_time) == TM485_ESTIMATOR_BRIDGING);
    } else if (i % 2 == 0) {
      tm485_estimator_update_sample(&estimator, &sample);
      tm485_fixed_estimator_update_sample(&fixed, &sample);
    } else {
      tm485_estimator_update(&estimator, sample.position, sample.latch_time);
      tm485_fixed_estimator_update(&fixed, sample.position, sample.latch_time);
    }
  }
  tm485_estimator_at(&estimator, 62500 * (tm485_time)400 + 1000, estimate);
  tm485_fixed_estimator_at(&fixed, 62500 * (tm485_time)400 + 1000, fixed_estimate);
  CHECK(tm485_estimate_valid(estimate) && fixed_estimate->state == TM485_ESTIMATOR_BRIDGING);
  CHECK(tm485_estimate_from(estimate, 19800) > 0.0F && tm485_estimate_from(estimate, 19800) < 2.0F);
  CHECK(tm485_estimator_innovation(&estimator) < 0.5F);
  tm485_estimator_reset(&estimator);
  tm485_fixed_estimator_reset(&fixed);
  {
    tm485_estimate after;
    tm485_estimator_at(&estimator, 0, &after);
    CHECK(after.state == TM485_ESTIMATOR_EMPTY);
  }
  return 0;
}

int use_wrong_arguments(const test_line* line) {
  static tm485_profile profile;
  static tm485_bus bus;
  static tm485_axis axis;
  static tm485_eeprom eeprom;
  static tm485_reset reset;
  tm485_estimator_gains broken = kGains;
  tm485_port port = line->port;
  tm485_bus_config config;
  tm485_axis_setup setup;
  uint8_t value[8];
  bool known[8];
  union {
    tm485_bus bus;
    unsigned char bytes[sizeof(tm485_bus)];
  } crooked[2];
  CHECK(tm485_profile_init(NULL, "tm485_17") == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_profile_init(&profile, NULL) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_profile_compile(&profile, NULL, NULL) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_profile_init(&profile, "tm485_17") == TM485_OK);
  tm485_bus_config_default(&config);
  CHECK(tm485_bus_init(NULL, &port, &profile, &config) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_bus_init(&bus, NULL, &profile, &config) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_bus_init(&bus, &port, NULL, &config) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_bus_init(&bus, &port, &profile, NULL) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_bus_init((tm485_bus*)(void*)(crooked[0].bytes + 1), &port, &profile, &config) ==
        TM485_ERR_BAD_ARGUMENT);
  port.transmission = NULL;
  CHECK(tm485_bus_init(&bus, &port, &profile, &config) == TM485_ERR_BAD_ARGUMENT);
  port = line->port;
  tm485_bus_config_cycle(&config, 5, 0);
  CHECK(tm485_bus_init(&bus, &port, &profile, &config) == TM485_ERR_BAD_ARGUMENT);
  config.step_count = 0;
  tm485_bus_config_add(&config, TM485_ID_SINGLE_TURN, 200, 1);
  CHECK(config.step_count == TM485_MAX_STEPS + 1);
  CHECK(tm485_bus_init(&bus, &port, &profile, &config) == TM485_ERR_BAD_ARGUMENT);
  tm485_bus_config_default(&config);
  config.phase = 3;
  CHECK(tm485_bus_init(&bus, &port, &profile, &config) == TM485_ERR_BAD_ARGUMENT);
  tm485_bus_config_default(&config);
  config.axis.units = 4;
  CHECK(tm485_bus_init(&bus, &port, &profile, &config) == TM485_ERR_BAD_ARGUMENT);
  tm485_bus_config_default(&config);
  config.axis.pole_pairs = 0; /* a value, but none that start() accepts */
  CHECK(tm485_bus_init(&bus, &port, &profile, &config) == TM485_OK);
  CHECK(tm485_bus_start(&bus, 0, NULL) == TM485_ERR_BAD_ARGUMENT);

  tm485_axis_setup_default(&setup);
  CHECK(tm485_axis_init(NULL, &port, &profile, &setup) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_axis_init(&axis, &port, &profile, NULL) == TM485_ERR_BAD_ARGUMENT);
  broken.period = 0;
  setup.gains = &broken;
  CHECK(tm485_axis_init(&axis, &port, &profile, &setup) == TM485_ERR_BAD_ARGUMENT);

  CHECK(tm485_eeprom_init(NULL, &profile, NULL, NULL, 0) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_eeprom_init(&eeprom, &profile, value, known, 8) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_eeprom_init(&eeprom, &profile, value, NULL, 889) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_eeprom_init(&eeprom, &profile, NULL, NULL, 0) == TM485_OK);
  CHECK(tm485_eeprom_bytes(&eeprom) == 889);
  CHECK(tm485_eeprom_start_read(&eeprom, 885, value, 5) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_reset_init(NULL, &profile, NULL) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_reset_init(&reset, &profile, NULL) == TM485_OK);
  CHECK(tm485_reset_start(&reset, 3) == TM485_ERR_BAD_ARGUMENT);
  return 0;
}
